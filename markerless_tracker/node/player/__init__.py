"""The node `player`: publishes the images of a bag as topics.

It prefetches the images and keeps the pace of the recording.
"""
