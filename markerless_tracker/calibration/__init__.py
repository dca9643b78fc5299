"""Calibration of cameras with a board: corners in images, start values, bundle adjustment, doubts.

Also the correction of a calibration by the contours of a tracked person.
"""
