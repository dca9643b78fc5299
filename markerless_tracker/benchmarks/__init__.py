"""Benchmarks: accuracy and speed measured on recordings.

`track` and the nodes do not import it.
"""
