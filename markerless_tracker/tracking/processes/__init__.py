"""Segmentation and tracking in processes of their own: no part waits for another's interpreter.

`segmenting` and `fitting` start and ask the processes; `*_main` are their main programs.
"""
