"""What the tracker node puts out: results and frames as topics, result files, debug images.

Publishers are created by the node and fed in the worker's thread.
"""
