"""A causal filter that calms what stands and lets pass what moves.

One Euro filter (Casiez, Roussel and Vogel, CHI 2012): an exponential filter of each parameter whose
cutoff rises with the parameter's speed.
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.partitions.sppso import translations

CUTOFF_HZ = 1.5
"""Cutoff of what stands still."""
RISE_ANGLE, RISE_PLACE = 8.0, 24.0
"""Hz of cutoff per rad/s and per m/s."""
SPEED_CUTOFF_HZ = 4.0
_GAP_NS = 300_000_000


class OneEuro:
    """Filters the poses of one body.

    Args:
        body: says which parameters are places and which are angles.
    """

    def __init__(self, body: BodyModel) -> None:
        self._rise = np.full(body.size, RISE_ANGLE)
        self._rise[translations(body)] = RISE_PLACE
        self.reset()

    def reset(self) -> None:
        """Forget the poses so far."""
        self._pose: FloatArray | None = None
        self._speed = np.zeros_like(self._rise)
        self._stamp_ns = 0

    def __call__(self, pose: FloatArray, stamp_ns: int) -> FloatArray:
        """The filtered pose (p,) at a stamp; after a gap it begins anew."""
        elapsed_ns = stamp_ns - self._stamp_ns
        self._stamp_ns = stamp_ns
        if self._pose is None or not 0 < elapsed_ns <= _GAP_NS:
            self._pose, self._speed = pose.copy(), np.zeros_like(self._rise)
            return pose
        seconds = elapsed_ns * 1e-9
        speed = (pose - self._pose) / seconds
        self._speed += _share(SPEED_CUTOFF_HZ, seconds) * (speed - self._speed)
        share = _share(CUTOFF_HZ + self._rise * np.abs(self._speed), seconds)
        self._pose = self._pose + share * (pose - self._pose)
        return self._pose.copy()


def _share(cutoff_hz: FloatArray | float, seconds: float) -> FloatArray:
    """Share of a new value that an exponential filter of that cutoff takes."""
    turn = 2.0 * np.pi * np.asarray(cutoff_hz, dtype=np.float64) * seconds
    return np.asarray(turn / (turn + 1.0))
