"""Detects a body that is too small: the silhouettes extend beyond it above and below.

A body of too little stature cannot fill the silhouettes: the person's head or feet lie outside of
it. A body that is too large is not detected: it fills them with bent knees.
"""

import math
from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.camera import CameraModel
from markerless_tracker.records import TrackResult
from markerless_tracker.results.verdict.histogram import Histogram
from markerless_tracker.tracking.search import pixels_per_m

LEAST = 6
"""Least number of comparisons for a camera to count."""
LEAST_CAMERAS = 2
"""Least number of such cameras for a result."""
_FRAMES = 0.75
"""Quantile over the frames. In some frames a body that is too small fills the silhouette of the
head with its arms."""
_UPRIGHT = 0.8
"""Least downward component of a camera's v axis, a unit vector, for an upright image."""
_PELVIS = MARKER_NAMES.index("Pelvis")
_MOST_M, _BINS = 1.0, 400


class Beyond:
    """Measures by camera how far the silhouette extends beyond the body, up and down together."""

    def __init__(self) -> None:
        self._found: dict[str, Histogram] = {}

    def add(self, result: TrackResult, camera: CameraModel, covered: NDArray[np.bool_]) -> None:
        """Add a camera's view of a frame.

        Args:
            result: of the frame, with markers.
            camera: the camera; ignored if its image is not upright.
            covered: (h, w) mask of the pixels that the body covers.
        """
        if result.markers_m is None or -camera.T_world_cam[2, 1] < _UPRIGHT:
            return
        px_per_m = pixels_per_m(camera, result.markers_m[_PELVIS])
        if not px_per_m > 0.0:
            return
        observation = result.observations[camera.name]
        silhouette = _touching(observation.in_full_frame(observation.mask), covered)
        person = np.flatnonzero(silhouette.any(axis=1))
        body = np.flatnonzero(covered.any(axis=1))
        if not person.size or not body.size:
            return
        beyond_px = (body[0] - person[0]) + (person[-1] - body[-1])
        # Each of the two ends is uncertain by half a row.
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
        """Median over the cameras, m, robust to a shadow in one of them; NaN if unknown."""
        found = list(self.by_camera_m.values())
        return float(np.median(found)) if len(found) >= LEAST_CAMERAS else math.nan


def _touching(silhouette: NDArray[np.bool_], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The patches (h, w) of a silhouette that the body covers in part; others are specks."""
    _, patches = cv2.connectedComponents(silhouette.view(np.uint8), connectivity=8)
    touched = np.unique(patches[silhouette & covered])
    return np.isin(patches, touched) & silhouette
