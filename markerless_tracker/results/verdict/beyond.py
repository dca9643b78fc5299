"""How far silhouettes reach beyond the body above and below: a body that is too small.

A body of too little stature cannot fill the silhouettes: head or feet of the person lie outside of
it. One that is too large fills them with bent knees.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.camera import CameraModel
from markerless_tracker.records import TrackResult
from markerless_tracker.results.verdict.histogram import Histogram
from markerless_tracker.tracking.search import pixels_per_m

LEAST = 6
"""Comparisons of a camera without which it does not count."""
LEAST_CAMERAS = 2
_FRAMES = 0.75
"""Quantile over the frames: arms of a body that is too small fill the head in some of them."""
_UPRIGHT = 0.8
_PELVIS = MARKER_NAMES.index("Pelvis")
_MOST_M, _BINS = 1.0, 400


class Beyond:
    """Sums up, by camera, how far the silhouette goes beyond the body's outline up and down."""

    def __init__(self) -> None:
        self._found: dict[str, Histogram] = {}

    def add(self, result: TrackResult, camera: CameraModel, covered: NDArray[np.bool_]) -> None:
        """Take a camera's view of a frame.

        Args:
            result: of the frame, with markers.
            camera: the camera; one whose image is not upright is passed over.
            covered: (h, w) what the body covers.
        """
        if result.markers_m is None or -camera.T_world_cam[2, 1] < _UPRIGHT:
            return
        px_per_m = pixels_per_m(camera, result.markers_m[_PELVIS])
        if not px_per_m > 0.0:
            return
        observation = result.observations[camera.name]
        person = np.flatnonzero(observation.in_full_frame(observation.mask).any(axis=1))
        body = np.flatnonzero(covered.any(axis=1))
        if not person.size or not body.size:
            return
        beyond_px = (body[0] - person[0]) + (person[-1] - body[-1])
        # Each of the two ends is known to half a row.
        beyond_px -= np.sign(beyond_px)
        found = self._found.setdefault(camera.name, Histogram(-_MOST_M, _MOST_M, _BINS))
        found.add(float(beyond_px) / px_per_m)

    @property
    def by_camera_m(self) -> Mapping[str, float]:
        """Camera -> upper quartile over the frames, m."""
        counted = {n: found for n, found in self._found.items() if found.count >= LEAST}
        return {n: found.quantile(_FRAMES) for n, found in counted.items()}

    @property
    def median_m(self) -> float:
        """Median over the cameras, m: a shadow below the feet is one camera's; NaN if unknown."""
        found = list(self.by_camera_m.values())
        return float(np.median(found)) if len(found) >= LEAST_CAMERAS else math.nan
