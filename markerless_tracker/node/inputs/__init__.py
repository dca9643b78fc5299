"""Inputs of a camera: images or evidence, received, checked and passed on; for several nodes."""
