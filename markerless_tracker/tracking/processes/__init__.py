"""Segmentation and tracking in separate processes, so that neither waits for another's interpreter.

`segmenting` and `fitting` start the processes and send them requests; `*_main` are their main
programs.
"""
