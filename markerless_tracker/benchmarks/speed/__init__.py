"""Computing time of each part, and its ratio to a fixed reference.

The measurements, the reference evaluation and the frames used.
"""
