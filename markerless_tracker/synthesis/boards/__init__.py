"""Synthetic recordings of a calibration board, with the exact calibration.

A board that lies on the floor, is shown to every camera and moves through their common view.
"""

from markerless_tracker.synthesis.boards.scene import BoardScene

__all__ = ["BoardScene"]
