"""Keeps the worker's pace up with the images.

Evidence is made ahead; a worker that is late spends less effort on each set.
"""
