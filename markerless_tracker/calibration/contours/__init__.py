"""Correction of a calibration by a tracked person: cameras, poses and body fit the contours.

Method: docs/calibration-by-contours.md. The cameras' time offsets are found likewise.
"""
