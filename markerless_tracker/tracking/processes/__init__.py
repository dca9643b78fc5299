"""Child processes, and what they share with this one; tracking in a process of its own.

No process waits for another's interpreter. `tracker_process` starts the process that tracks and
sends it requests; `tracker_process_main` is its main program. `evidence.segmenting` does the same
for segmentation.
"""
