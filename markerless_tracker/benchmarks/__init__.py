"""Benchmarks: accuracy and speed measured on recordings.

`track` and the nodes need nothing of it.
"""
