"""A person who walks faces the way that the trunk moves.

Arms that hang and legs that pass each other look alike from many sides: a body whose limbs are in
each other's place can turn away from a person who walks a curve, and explain the silhouettes nearly
as well for a second or more.
"""

from collections import deque

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.start.mirror import TRUNK, mirror_of, turned_by

EVERY_NS = 100_000_000
"""Time between two comparisons, while the body faces elsewhere."""
WALKED_NS, LEAST_WALKED_NS = 500_000_000, 300_000_000
"""Time over which the trunk's move is the way that the person walks, and the least such time."""
LEAST_SPEED_M_S = 0.3
"""A slower trunk sways."""
LEAST_ANGLE_RAD = 0.7
"""A body that faces the way of walking by less is left as it is: the way of a curve lags."""
LEAST_GAIN = 0.004
"""Least rise of f_s from which on the body is turned: people seldom walk backwards or sideways, so
that a rise beyond chance is enough."""
CLOSE = 0.03
"""As of `LimbSearch.compared`."""


class WalkingWatch:
    """Proposes poses that face the way that the person walks."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget where the trunk was."""
        self._trunks: deque[tuple[int, FloatArray]] = deque()
        self._compared_ns: int | None = None

    def due(
        self, body: BodyModel, pose: FloatArray, limits: FloatArray, stamp_ns: int
    ) -> list[FloatArray]:
        """Poses (p,) that face the way of walking, if the body does not and a comparison is due.

        The joints keep their angles in one of them; in the other they are as in a mirror.

        Args:
            body: the body.
            pose: (p,) the estimate.
            limits: (2, p), kept.
            stamp_ns: its time.
        """
        points = markers(body, pose)
        way_rad = self._way_rad(points[TRUNK].mean(axis=0), stamp_ns)
        faced_rad = heading(points)
        if way_rad is None or heading_difference(way_rad, faced_rad) < LEAST_ANGLE_RAD:
            return []
        last_ns = self._compared_ns
        if last_ns is not None and 0 <= stamp_ns - last_ns < EVERY_NS:
            return []
        self._compared_ns = stamp_ns
        both = (pose, mirror_of(body).of(pose))
        found = [turned_by(body, other, way_rad - faced_rad, about=pose) for other in both]
        return [np.clip(other, *limits) for other in found]

    def _way_rad(self, trunk_m: FloatArray, stamp_ns: int) -> float | None:
        """Direction of walking, about the vertical; None if the person stands or for too short."""
        if self._trunks and stamp_ns <= self._trunks[-1][0]:
            self._trunks.clear()
        self._trunks.append((stamp_ns, trunk_m))
        while stamp_ns - self._trunks[0][0] > WALKED_NS:
            self._trunks.popleft()
        since_ns, from_m = self._trunks[0]
        along, across = (trunk_m - from_m)[:2]
        seconds = (stamp_ns - since_ns) * 1e-9
        if stamp_ns - since_ns < LEAST_WALKED_NS:
            return None
        if float(np.hypot(along, across)) < LEAST_SPEED_M_S * seconds:
            return None
        return float(np.arctan2(across, along))
