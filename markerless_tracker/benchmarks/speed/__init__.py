"""Time of each part, as ratios to a fixed reference.

The reference evaluation and the frames that are measured on.
"""
