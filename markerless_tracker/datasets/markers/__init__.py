"""Marker positions over time and the TRC files that hold them.

OpenSim's format, Y up as Pose2Sim writes it.
"""
