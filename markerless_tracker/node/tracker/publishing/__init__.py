"""Outputs of the tracker node: results and frames as topics, result files, debug images.

The node creates the publishers; the publishing thread calls them.
"""
