"""A causal low-pass filter whose cutoff rises with the motion.

One Euro filter (Casiez, Roussel and Vogel, CHI 2012): an exponential filter of each parameter whose
cutoff rises with the parameter's speed. Ours rises with the whole body's motion, too, because a
joint at a point of reversal is not at rest while the person walks. With each parameter's own speed
only, the pelvis of a jogging person, whose angles change little, lags by a frame.
"""

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.geometry import FloatArray

CUTOFF_HZ = 8.0
"""Cutoff at rest: a lower cutoff lags a standing, swaying person by more than a frame at 60 Hz."""
RISE_ANGLE, RISE_PLACE = 4.0, 12.0
"""Hz of cutoff per rad/s and per m/s of the parameter."""
RISE_MOTION = 200.0
"""Hz of cutoff per (m/s)², mean over the markers: 200 Hz, practically no filter, in a walk."""
SPEED_CUTOFF_HZ = 2.0
"""Cutoff of the speeds, in which jitter cancels out."""
_GAP_NS = 300_000_000


class OneEuro:
    """Filters the poses of one body.

    Args:
        body: determines which parameters are positions and which are angles, and the markers.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        self._rise = np.full(body.size, RISE_ANGLE)
        self._rise[body.translations] = RISE_PLACE
        self.reset()

    def reset(self) -> None:
        """Forget the poses so far."""
        self._pose: FloatArray | None = None
        self._stamp_ns = 0

    def __call__(self, pose: FloatArray, stamp_ns: int) -> FloatArray:
        """The filtered pose (p,) at a stamp; the filter restarts after a gap."""
        elapsed_ns = stamp_ns - self._stamp_ns
        self._stamp_ns = stamp_ns
        points = markers(self._body, pose)
        if self._pose is None or not 0 < elapsed_ns <= _GAP_NS:
            self._pose, self._speed = pose.copy(), np.zeros_like(self._rise)
            self._points, self._points_speed = points, np.zeros_like(points)
            return pose
        seconds = elapsed_ns * 1e-9
        rate = _gain(SPEED_CUTOFF_HZ, seconds)
        self._points_speed += rate * ((points - self._points) / seconds - self._points_speed)
        self._points = points
        self._speed += rate * ((pose - self._pose) / seconds - self._speed)
        motion = float((self._points_speed**2).sum(axis=1).mean())
        cutoff = CUTOFF_HZ + self._rise * np.abs(self._speed) + RISE_MOTION * motion
        self._pose = self._pose + _gain(cutoff, seconds) * (pose - self._pose)
        return self._pose.copy()


def _gain(cutoff_hz: FloatArray | float, seconds: float) -> FloatArray:
    """Weight of a new value in an exponential filter with a given cutoff."""
    phase = 2.0 * np.pi * np.asarray(cutoff_hz, dtype=np.float64) * seconds
    return np.asarray(phase / (phase + 1.0))
