"""The node `tracker`: image topics in, the pose of one person out.

Receives and matches images, tracks in one worker thread, publishes results.
"""
