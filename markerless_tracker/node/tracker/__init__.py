"""The node `tracker`: image topics in, the pose of one person out.

It receives and matches images, tracks in a worker thread, and publishes results.
"""
