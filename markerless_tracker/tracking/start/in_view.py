"""Whether enough of a body is in view for an automatic start.

One outline and a hand in another view do not determine depth, heading and most limbs, and two whole
outlines may fit a person with the opposite heading. A start from too little evidence is wrong, and
the body's sections are fitted to it. So a person entering at the image border is not tracked until
enough is in view.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

LEAST_IN_VIEW = 0.7
"""Fraction of the markers that must be in view: eleven of fifteen markers lie above the knees."""
ENOUGH_CAMERAS, LEAST_CAMERAS = 3, 2
"""Cameras that must have the person in view for a start at once, and after `PATIENCE_NS`."""
PATIENCE_NS = 2_000_000_000
"""Time that a person in view of two cameras has to come into view of a third one."""
GAP_NS = 500_000_000
"""The time of `PATIENCE_NS` starts again after a gap of this length in which two cameras do not see
the person."""
NEAR_M = 1.0
"""A hull farther than this from the hulls of the last frames is another one."""


class _InView(NamedTuple):
    """A hull in view of two cameras: its last place, when it came into view and was seen last."""

    place_m: FloatArray
    since_ns: int
    last_ns: int


class InViewGate:
    """Allows a start at once if three cameras see the person; if two do, after `PATIENCE_NS`."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget which hulls are in view."""
        self._hulls: list[_InView] = []
        self._frame_ns = self._before_ns = 0

    def enough(
        self, body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], stamp_ns: int
    ) -> bool:
        """Whether a search may start from a pose at a time.

        Args:
            body: the body.
            pose: (p,) approximate pose of the person.
            cameras: the cameras that have an image.
            stamp_ns: the time; ascending, except where a recording restarts.
        """
        with_image = list(cameras)
        if fraction_in_view(body, pose, with_image, LEAST_CAMERAS) < LEAST_IN_VIEW:
            return False
        since_ns = self._seen_since_ns(markers(body, pose).mean(axis=0), stamp_ns)
        if stamp_ns - since_ns >= PATIENCE_NS:
            return True
        required = min(ENOUGH_CAMERAS, len(with_image))
        return fraction_in_view(body, pose, with_image, required) >= LEAST_IN_VIEW

    def _seen_since_ns(self, place_m: FloatArray, stamp_ns: int) -> int:
        """Time since which two cameras see the hull at a place (3,), which is noted."""
        if stamp_ns != self._frame_ns:
            self._before_ns, self._frame_ns = self._frame_ns, stamp_ns
        # Frames may come less often than that.
        gap_ns = max(GAP_NS, min(stamp_ns - self._before_ns, PATIENCE_NS))
        hulls = [v for v in self._hulls if 0 <= stamp_ns - v.last_ns <= gap_ns]
        away_m = [float(np.linalg.norm(hull.place_m - place_m)) for hull in hulls]
        since_ns = stamp_ns
        if away_m and min(away_m) <= NEAR_M:
            since_ns = hulls.pop(int(np.argmin(away_m))).since_ns
        self._hulls = [*hulls, _InView(place_m, since_ns, stamp_ns)]
        return since_ns


def fraction_in_view(
    body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], count: int
) -> float:
    """Fraction of the markers of a pose (p,) that lie in the frames of at least `count` cameras."""
    points = markers(body, pose)
    seen = np.zeros(len(points), dtype=np.int64)
    for camera in cameras:
        pixels = project_camera(points, camera)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0) & (pixels <= np.array(camera.size_px) - 1.0)
        seen += inside.all(axis=1)
    return float((seen >= count).mean())
