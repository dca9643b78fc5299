"""Corrects the heading of a walking person, who faces the walking direction.

Hanging arms and passing legs look alike from many sides. With its limbs in each other's place, a
body can rotate away from a person walking a curve, and explain the silhouettes nearly as well for a
second or more.
"""

from collections import deque

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.mirror import TRUNK, mirror_of, rotated_by

EVERY_NS = 100_000_000
"""Time between two comparisons, while heading and walking direction differ."""
WALKED_NS, LEAST_WALKED_NS, MOST_WALKED_NS = 500_000_000, 300_000_000, 2_000_000_000
"""Usual, least and longest time over which the trunk's displacement gives the walking direction."""
LEAST_SPEED_M_S = 0.3
"""A trunk slower than this sways and does not walk."""
LEAST_ANGLE_RAD = 0.7
"""A heading nearer than this to the walking direction is kept, since that lags in a curve."""
LEAST_GAIN = 0.004
"""Least gain for which the body is rotated. People seldom walk backwards or sideways, so a gain
beyond chance is enough."""
CLOSE = 0.03
"""Argument of `LimbSearch.compared`."""


class WalkingWatch:
    """Proposes poses whose heading is the walking direction."""

    def __init__(self) -> None:
        self._trunks: deque[tuple[int, FloatArray]] = deque()
        self._compared_ns: int | None = None

    def note(self, body: BodyModel, pose: FloatArray, stamp_ns: int) -> None:
        """Note where the trunk is in the pose (p,) of a frame."""
        if self._trunks and stamp_ns <= self._trunks[-1][0]:
            self._trunks.clear()
        self._trunks.append((stamp_ns, markers(body, pose)[TRUNK].mean(axis=0)))
        # Two frames tell a direction, even if they are farther apart.
        while len(self._trunks) > 2 and stamp_ns - self._trunks[0][0] > WALKED_NS:
            self._trunks.popleft()
        if stamp_ns - self._trunks[0][0] > MOST_WALKED_NS:
            self._trunks.popleft()

    def take_due(
        self, body: BodyModel, pose: FloatArray, limits: FloatArray, stamp_ns: int
    ) -> list[FloatArray]:
        """Poses (p,) facing the walking direction, if the body does not and a comparison is due.

        The time is noted as that of a comparison. The frame has been noted (`note`). The joints
        keep their angles in one of the poses; in the other, left and right are exchanged.

        Args:
            body: the body.
            pose: (p,) the estimate.
            limits: (2, p) of the poses.
            stamp_ns: its time.
        """
        direction_rad, faced_rad = self._direction_rad(), heading(markers(body, pose))
        if direction_rad is None or heading_difference(direction_rad, faced_rad) < LEAST_ANGLE_RAD:
            return []
        last_ns = self._compared_ns
        if last_ns is not None and 0 <= stamp_ns - last_ns < EVERY_NS:
            return []
        self._compared_ns = stamp_ns
        both = (pose, mirror_of(body).of(pose))
        found = [rotated_by(body, other, direction_rad - faced_rad, about=pose) for other in both]
        return [np.clip(other, *limits) for other in found]

    def _direction_rad(self) -> float | None:
        """Walking direction, about the vertical; None if the person stands, or began just now."""
        (since_ns, from_m), (stamp_ns, at_m) = self._trunks[0], self._trunks[-1]
        along, across = (at_m - from_m)[:2]
        seconds = (stamp_ns - since_ns) * 1e-9
        if stamp_ns - since_ns < LEAST_WALKED_NS:
            return None
        if float(np.hypot(along, across)) < LEAST_SPEED_M_S * seconds:
            return None
        return float(np.arctan2(across, along))
