"""Inputs of the cameras, images or evidence, and what is counted of each for `state`."""
