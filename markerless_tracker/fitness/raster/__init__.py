"""Projected cones as bits: outlines, filling and counting of pixels.

The kernels behind f_s and f_e.
"""
