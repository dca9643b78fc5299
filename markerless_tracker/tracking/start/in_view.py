"""Whether enough of a body is in view to start from.

One outline and a hand in another view leave depth, heading and most of the limbs open, and two
whole outlines may fit a person with the opposite heading. A start from too little is wrong, and the
body's sections are fitted to it. So a person entering at the image border is not tracked until
enough is in view.
"""

from collections.abc import Iterable

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

LEAST_IN_VIEW = 0.7
"""Fraction of the markers that must be in view: eleven of fifteen are so from the hips up."""
ENOUGH_CAMERAS, LEAST_CAMERAS = 3, 2
"""Cameras that allow a start at once, and after `PATIENCE_NS`."""
PATIENCE_NS = 2_000_000_000
"""How long a person in two cameras' views may take to come into a third one's."""
GAP_NS = 500_000_000
"""After so long without a person in two cameras' views the next one is another visit."""


class InViewGate:
    """Allows a start at once if three cameras see the person, else after a while."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No person is in view."""
        self._since_ns: int | None = None
        self._last_ns = 0

    def enough(
        self, body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], stamp_ns: int
    ) -> bool:
        """Whether a search may start from a pose at a time.

        Args:
            body: the body.
            pose: (p,) about where the person is.
            cameras: those that have an image.
            stamp_ns: the time; in order, except where a recording begins anew.
        """
        seeing = list(cameras)
        if fraction_in_view(body, pose, seeing, LEAST_CAMERAS) < LEAST_IN_VIEW:
            return False
        if self._since_ns is None or not 0 <= stamp_ns - self._last_ns <= GAP_NS:
            self._since_ns = stamp_ns
        self._last_ns = stamp_ns
        if stamp_ns - self._since_ns >= PATIENCE_NS:
            return True
        wanted = min(ENOUGH_CAMERAS, len(seeing))
        return fraction_in_view(body, pose, seeing, wanted) >= LEAST_IN_VIEW


def fraction_in_view(
    body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], count: int
) -> float:
    """Fraction of the markers of a pose (p,) that lie in the frames of so many cameras or more."""
    points = markers(body, pose)
    seen = np.zeros(len(points), dtype=np.int64)
    for camera in cameras:
        pixels = project_camera(points, camera)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0) & (pixels <= np.array(camera.size_px) - 1.0)
        seen += inside.all(axis=1)
    return float((seen >= count).mean())
