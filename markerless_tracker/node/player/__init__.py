"""The node `player`: the images of a bag as topics.

Reads prefetch and keeps the pace of the recording.
"""
