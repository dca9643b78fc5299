"""Lengths and sections of the body, fitted to silhouettes.

`fit_shape` holds the poses; `BodyFit` fits one body together with the poses of several frames.
"""

from markerless_tracker.fitness.shape.body_fit import BodyFit
from markerless_tracker.fitness.shape.section_fit import CORRELATION_M, fit_shape
from markerless_tracker.fitness.shape.sections import Sections

__all__ = ["CORRELATION_M", "BodyFit", "Sections", "fit_shape"]
