"""Keeps frames with different poses, for fits of the sections."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.person.spread import posture_angles

MOST = 8
"""Number of frames that are kept."""
VARIETY_RAD = 0.2
"""Least root mean square difference of joint angles by which a pose differs."""
FIRST_WEIGHT = 5.0
"""Weight of the first frame, relative to each later one."""


class VariedFrames:
    """Keeps the first frame, whose pose is known best, and later frames with other poses.

    Args:
        prior: the body with generic sections.
        contours: evidence of the first frame.
        pose: (p,) its pose.
    """

    def __init__(self, prior: BodyModel, contours: ContourFrame, pose: FloatArray) -> None:
        self.prior = prior
        self._frames = [(contours, pose)]

    def takes(self, pose: FloatArray, body: BodyModel) -> bool:
        """Whether a pose (p,) differs from all kept ones, and there is room."""
        if len(self._frames) >= MOST:
            return False
        angles = posture_angles(body)
        gaps = [np.sqrt(np.mean((pose - kept)[angles] ** 2)) for _, kept in self._frames]
        return bool(min(gaps) > VARIETY_RAD)

    def add(
        self, contours: ContourFrame, pose: FloatArray
    ) -> list[tuple[ContourFrame, FloatArray, float]]:
        """Keep a frame; returns all, weighted, for `shape_fitting`."""
        self._frames.append((contours, pose))
        first, *others = self._frames
        return [(*first, FIRST_WEIGHT), *((*other, 1.0) for other in others)]
