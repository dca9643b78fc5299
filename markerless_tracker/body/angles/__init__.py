"""Joint angles: those reported (OpenSim's names), and ball joints as a swing and a twist."""

from markerless_tracker.body.angles.definitions import ROOT_ANGLES
from markerless_tracker.body.angles.reader import AngleReader, Angles

__all__ = ["ROOT_ANGLES", "AngleReader", "Angles"]
