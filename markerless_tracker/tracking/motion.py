"""Motion of the tracked pose: prediction with damped constant velocity, and its uncertainty."""

import numpy as np

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.config import TrackerConfig

TRAINING_RATE_HZ = 60.0
"""Frame rate for which the published sigmas, changes of a parameter between frames, are valid."""
LIMB_SPEED_M_S = 2.0
LIMB_ACCELERATION_M_S2 = 60.0
"""Greatest speed and acceleration of a hand or foot relative to its prediction, which widen the
image regions. For a faster hand or foot a second, wider region is segmented."""
LEAST_NS = 4_000_000
"""Frames closer than this leave the velocity: errors of the pose would give high speeds."""


class MotionModel:
    """The pose of the last frame and its velocity, and predictions for the next frame.

    Args:
        start: (p,) pose before the first frame.
        config: `prediction`, `sigma.rate_max` and `region.margin_m`.

    Attributes:
        start: (p,) as given.
        pose: (p,) of the last frame.
        velocity_per_ns: (p,) change per nanosecond.
        stamp_ns: time of the last frame with a pose; None before the first.
    """

    def __init__(self, start: FloatArray, config: TrackerConfig) -> None:
        self.start = start
        self._config = config
        self.reset()

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings from the next frame on."""
        self._config = config

    def reset(self) -> None:
        """Return to the start pose, at rest, before the first frame."""
        self.pose = self.start
        self.velocity_per_ns = np.zeros(self.start.size)
        self.stamp_ns: int | None = None
        self._tracked = False

    def predict(self, stamp_ns: int, limits: FloatArray) -> FloatArray:
        """The pose (p,) expected at a time, within joint limits (2, p)."""
        elapsed_ns = self._elapsed_ns(stamp_ns)
        if elapsed_ns == 0:
            return self.pose
        bounded_ns = min(elapsed_ns, self._config.sigma.rate_max / TRAINING_RATE_HZ * 1e9)
        moved = self.pose + self._config.prediction * bounded_ns * self.velocity_per_ns
        return np.asarray(np.clip(moved, *limits))

    def reachable(self, stamp_ns: int, limits: FloatArray, speeds: FloatArray) -> FloatArray:
        """Limits (2, p) of the poses that can be reached from the last tracked pose by a time.

        Args:
            stamp_ns: the time.
            limits: (2, p) joint limits.
            speeds: (p,) greatest speeds, rad/s and m/s; infinite if unlimited.
        """
        elapsed_ns = self._elapsed_ns(stamp_ns)
        if elapsed_ns == 0 or not self._tracked:
            return limits
        around = np.multiply.outer([-1.0, 1.0], speeds * (elapsed_ns * 1e-9)) + self.pose
        return np.stack([np.maximum(limits[0], around[0]), np.minimum(limits[1], around[1])])

    def widening(self, stamp_ns: int) -> float:
        """Factor of sigma at a time: elapsed frames at the training rate, bounded."""
        elapsed_ns = self._elapsed_ns(stamp_ns)
        if elapsed_ns == 0:
            return 1.0
        return min(elapsed_ns * 1e-9 * TRAINING_RATE_HZ, self._config.sigma.rate_max)

    def region_margin_m(self, stamp_ns: int) -> float | None:
        """Margin around the predicted body that holds the person, m; None while not tracked."""
        elapsed_ns = self._elapsed_ns(stamp_ns)
        if elapsed_ns == 0 or not self._tracked:
            return None
        elapsed_s = elapsed_ns * 1e-9
        speed_m_s = min(LIMB_SPEED_M_S, 0.5 * LIMB_ACCELERATION_M_S2 * elapsed_s)
        return self._config.region.margin_m + speed_m_s * elapsed_s

    def update(
        self, pose: FloatArray, stamp_ns: int, *, tracked: bool, jumped: IntArray | None = None
    ) -> None:
        """Take the pose (p,) of a frame.

        Args:
            pose: the estimate.
            stamp_ns: its time.
            tracked: whether it agrees with the silhouettes; if not, the velocity is set to 0.
            jumped: indices of parameters that do not continue the last pose; their velocity is set
                to 0.
        """
        elapsed_ns = self._elapsed_ns(stamp_ns)
        change = pose - self.pose
        if not tracked or elapsed_ns == 0:
            self.velocity_per_ns = np.zeros(change.size)
        elif elapsed_ns >= LEAST_NS:
            self.velocity_per_ns = change / elapsed_ns
        else:
            self.velocity_per_ns = self.velocity_per_ns.copy()
        if jumped is not None:
            self.velocity_per_ns[jumped] = 0.0
        self.pose = pose
        self.stamp_ns = stamp_ns
        self._tracked = tracked

    def lose(self) -> None:
        """Note a frame without a person: the pose is kept, at rest."""
        self.velocity_per_ns = np.zeros(self.pose.size)
        self._tracked = False

    def shift(self, change: FloatArray, limits: FloatArray) -> None:
        """Move the last pose (p,) within limits (2, p); its velocity does not change."""
        self.pose = np.clip(self.pose + change, *limits)

    def since_s(self, stamp_ns: int) -> float:
        """Time since the last frame with a pose, s; 0 before it, and if time does not advance."""
        return self._elapsed_ns(stamp_ns) * 1e-9

    def _elapsed_ns(self, stamp_ns: int) -> int:
        """Time since the last frame; 0 before the first, and if time does not advance."""
        return 0 if self.stamp_ns is None else max(0, stamp_ns - self.stamp_ns)
