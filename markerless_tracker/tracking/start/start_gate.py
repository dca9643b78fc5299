"""Whether enough of a body is in view to start from: who comes in at the edge is waited for.

One outline and a hand in another view leave depth, heading and most of the limbs open, and two
whole outlines may still be explained by somebody who faces the other way. A start from too little
is wrong and, worse, goes on to fit the body's sections to what is seen.
"""

from collections.abc import Iterable

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

LEAST_IN_VIEW = 0.7
"""Share of the markers that must be in view: eleven of fifteen are so from the hips up."""
ENOUGH_CAMERAS, LEAST_CAMERAS = 3, 2
PATIENCE_NS = 2_000_000_000
"""How long somebody whom two cameras see is waited for to come into a third one's view."""


class StartGate:
    """Tells when to start from somebody: at once if three cameras see him, else after a while."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Nobody is there."""
        self._since_ns: int | None = None

    def enough(
        self, body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], stamp_ns: int
    ) -> bool:
        """Whether so much of a pose (p,) is in view at a time that it is no more waited for."""
        seeing = list(cameras)
        if share_in_view(body, pose, seeing, LEAST_CAMERAS) < LEAST_IN_VIEW:
            return False
        if self._since_ns is None or stamp_ns < self._since_ns:
            self._since_ns = stamp_ns
        if stamp_ns - self._since_ns >= PATIENCE_NS:
            return True
        wanted = min(ENOUGH_CAMERAS, len(seeing))
        return share_in_view(body, pose, seeing, wanted) >= LEAST_IN_VIEW


def share_in_view(
    body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel], count: int
) -> float:
    """Share of the markers of a pose (p,) that lie in the frames of so many cameras or more."""
    points = markers(body, pose)
    seen = np.zeros(len(points), dtype=np.int64)
    for camera in cameras:
        pixels = project_camera(points, camera)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0) & (pixels <= np.array(camera.size_px) - 1.0)
        seen += inside.all(axis=1)
    return float((seen >= count).mean())
