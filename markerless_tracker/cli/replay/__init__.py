"""Replays of a bag to a running tracker: processes of the ROS executables, and their figures.

The demo and `benchmark live` use them.
"""
