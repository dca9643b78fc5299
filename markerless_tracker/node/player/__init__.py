"""The node `player`: the images of a bag as topics.

Reads ahead and keeps the pace of the recording.
"""
