"""The recorder: writes topics of a running graph, unchanged, to an MCAP bag.

`node` subscribes to the topics; `process` runs the node.
"""
