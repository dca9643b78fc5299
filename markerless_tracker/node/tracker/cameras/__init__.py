"""Inputs of the cameras, images or evidence, and the counts of each camera for `state`."""
