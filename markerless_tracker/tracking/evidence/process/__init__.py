"""Segmentation in a process of its own, which the interpreter's lock does not hold up.

`parent` starts the process and hands images on in shared memory; `child` is its main program.
"""
