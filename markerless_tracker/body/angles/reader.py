"""Reported joint angles of poses, continuous in time, and their standard deviations.

Three angles describe a rotation in two ways: (a, b, c) and (a + 180, 180 - b, c + 180), each plus
full turns. The one nearest to the last frame's is reported. If the second angle is near 90 degrees
(gimbal lock), the first and the third rotate about the same axis, and the pose determines only
their sum (or difference). Its split between them is then kept from the last frame, the more the
nearer the second angle is to 90 degrees. Afterwards it approaches the pose's own split as fast as
`SPLIT_RAD_S` allows.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body.angles.segments import JointFrames, joint_frames
from markerless_tracker.body.kinematics import transforms
from markerless_tracker.body.model import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

SPLIT_COSINE = 0.7
"""The split is partly kept if the second angle's cosine is lower: within 45 degrees of 90."""
SPLIT_RAD_S = float(np.deg2rad(600.0))
"""The split changes as far as neither angle gets faster than this, where the sum is slower."""
_ACROSS_RAD_S = float(np.deg2rad(360.0))
LEAST_COSINE = 0.1
"""Standard deviations of the first and third angle do not grow beyond this cosine."""
MOST_SD_RAD = float(np.pi / np.sqrt(3.0))
"""Standard deviation of an unknown angle: that of a uniform distribution over a full turn."""
_USUAL_STEP_S = 1.0 / 60.0
_LONGEST_STEP_S = 0.5
_POSES = 8
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Angles:
    """Reported angles of one pose.

    Attributes:
        names: (n,) of the angles, `pelvis_tilt` and the other two of the pelvis among them.
        values_rad: (n,) angles; continuous in time, hence beyond half a turn where need be.
        sd_rad: (n,) standard deviations; None if those of the pose are unknown.
    """

    names: tuple[str, ...]
    values_rad: FloatArray
    sd_rad: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "values_rad", locked(self.values_rad, np.float64))
        if self.sd_rad is not None:
            object.__setattr__(self, "sd_rad", locked(self.sd_rad, np.float64))

    def degrees(self) -> dict[str, float]:
        """Angles by name, degrees."""
        return dict(zip(self.names, np.rad2deg(self.values_rad).tolist(), strict=True))

    def sd_degrees(self) -> dict[str, float] | None:
        """Standard deviations by name, degrees."""
        if self.sd_rad is None:
            return None
        return dict(zip(self.names, np.rad2deg(self.sd_rad).tolist(), strict=True))


class AngleReader:
    """Reads the angles of a body's poses, frame after frame.

    Args:
        body: the body; `take` another that differs in sizes only.

    Attributes:
        names: (n,) of the angles: those that the body's parameters can change, then the parameters
            that rotate what has no such angles, under their own names.
    """

    def __init__(self, body: BodyModel) -> None:
        self.take(body)
        self._sequences = _Sequences(self._frames)
        self._shown = self._changing()
        flat = [name for joint in self._frames.joints for name in joint.names]
        own = [name for name in body.joint_names if body.index(name) in self._frames.others]
        self._others = np.array([body.index(name) for name in own], dtype=np.int64)
        self.names = (*(flat[k] for k in self._shown), *own)
        self.reset()

    def take(self, body: BodyModel) -> None:
        """Read poses of this body from now on; the angles remain continuous."""
        self._body = body
        self._frames = joint_frames(body)

    def reset(self) -> None:
        """Forget the last pose."""
        self._split: _Split | None = None
        self._stamp_ns: int | None = None

    def read(
        self, pose: FloatArray, stamp_ns: int | None = None, covariance: FloatArray | None = None
    ) -> Angles:
        """The angles at a pose (p,).

        Args:
            pose: the pose.
            stamp_ns: its time; None = a 60th of a second after the last one.
            covariance: (p, p) of the pose; the deviations follow to first order.
        """
        nodes = transforms(self._body, pose)
        relative = self._frames.relative(nodes)
        values = self._sequences.angles(relative)
        if self._split is None:
            values = _smaller(values)
            self._split = _Split(values)
        else:
            values = self._split.follow(
                _nearest(values, self._split.shown), self._sequences.parity, self._step_s(stamp_ns)
            )
        self._stamp_ns = stamp_ns
        shown = (self._sequences.signs * values).ravel()[self._shown]
        shown = np.concatenate([shown, pose[self._others]])
        sd = None
        if covariance is not None:
            jacobian = self._jacobian(values, nodes)
            variance = ((jacobian @ covariance) * jacobian).sum(axis=1)
            sd = np.minimum(np.sqrt(np.maximum(variance, 0.0)), MOST_SD_RAD)
        return Angles(self.names, shown, sd)

    def jacobian(self, pose: FloatArray) -> FloatArray:
        """Derivatives (n, p) of the angles by the parameters of a pose (p,)."""
        nodes = transforms(self._body, pose)
        values = self._sequences.angles(self._frames.relative(nodes))
        if self._split is not None:
            values = _nearest(values, self._split.shown)
        return self._jacobian(values, nodes)

    def _jacobian(self, values: FloatArray, nodes: FloatArray) -> FloatArray:
        own = np.zeros((len(self._others), self._body.size))
        own[np.arange(len(self._others)), self._others] = 1.0
        return np.concatenate([self._full_jacobian(values, nodes)[self._shown], own])

    def _full_jacobian(self, values: FloatArray, nodes: FloatArray) -> FloatArray:
        velocities = self._frames.velocities(self._body, nodes)
        jacobian = self._sequences.signs[:, :, None] * self._sequences.rates(values, velocities)
        return jacobian.reshape(-1, self._body.size)

    def _step_s(self, stamp_ns: int | None) -> float:
        if stamp_ns is None or self._stamp_ns is None:
            return _USUAL_STEP_S
        return float(np.clip((stamp_ns - self._stamp_ns) * 1e-9, 0.0, _LONGEST_STEP_S))

    def _changing(self) -> list[int]:
        """Which of the joints' angles, flat, have a name and change with the parameters."""
        rng = np.random.default_rng(0)
        named = np.array([bool(n) for joint in self._frames.joints for n in joint.names])
        changes = np.zeros(len(named), dtype=np.bool_)
        for _ in range(_POSES):
            pose = self._body.neutral + rng.uniform(-0.3, 0.3, self._body.size)
            nodes = transforms(self._body, pose)
            values = self._sequences.angles(self._frames.relative(nodes))
            changes |= np.abs(self._full_jacobian(values, nodes)).max(axis=1, initial=0.0) > 1e-6
        return [int(k) for k in np.flatnonzero(named & changes)]


class _Sequences:
    """Rotations to and from angles about the axes (i, j, k) of each of n joints."""

    def __init__(self, frames: JointFrames) -> None:
        order = np.array([joint.order for joint in frames.joints]).reshape(-1, 3)
        self.signs = np.array([joint.signs for joint in frames.joints], float).reshape(-1, 3)
        self._i, self._j, self._k = order.T
        self._n = np.arange(len(order))
        self.parity = np.where((self._j - self._i) % 3 == 1, 1.0, -1.0)

    def angles(self, rotation: FloatArray) -> FloatArray:
        """Angles (n, 3), the second within 90 degrees, of rotations (n, 3, 3)."""
        n, i, j, k, e = self._n, self._i, self._j, self._k, self.parity
        second = np.arcsin(np.clip(e * rotation[n, i, k], -1.0, 1.0))
        first = np.arctan2(-e * rotation[n, j, k], rotation[n, k, k])
        third = np.arctan2(-e * rotation[n, i, j], rotation[n, i, i])
        return np.stack([first, second, third], axis=1)

    def rates(self, angles: FloatArray, velocity: FloatArray) -> FloatArray:
        """Rates (n, 3, p) of angles (n, 3) at angular velocities (n, 3, p), first axes fixed."""
        n, e = self._n, self.parity[:, None]
        a, b = angles[:, 0, None], angles[:, 1, None]
        first, second, third = velocity[n, self._i], velocity[n, self._j], velocity[n, self._k]
        # Into the axes after the first rotation.
        cos, sin = np.cos(a), e * np.sin(a)
        second, third = cos * second + sin * third, cos * third - sin * second
        cosine = np.cos(b)
        third = third / np.where(cosine < 0.0, -1.0, 1.0) / np.maximum(np.abs(cosine), LEAST_COSINE)
        return np.stack([first - e * np.sin(b) * third, second, third], axis=1)


def _smaller(angles: FloatArray) -> FloatArray:
    """The solution (n, 3) with the smaller angles, of two."""
    other = wrapped(angles * [1.0, -1.0, 1.0] + np.pi)
    far = (other**2).sum(axis=1) < (angles**2).sum(axis=1)
    return np.where(far[:, None], other, angles)


def wrapped(angles: FloatArray) -> FloatArray:
    """Angles within half a turn of 0, rad."""
    return np.asarray(angles - _TURN * np.round(angles / _TURN))


def _nearest(angles: FloatArray, last: FloatArray) -> FloatArray:
    """The solution (n, 3), plus full turns, that is nearest to the last angles (n, 3), of two."""
    change = wrapped(angles - last)
    of_other = wrapped(angles * [1.0, -1.0, 1.0] + np.pi - last)
    far = (of_other**2).sum(axis=1) < (change**2).sum(axis=1)
    return np.asarray(last + np.where(far[:, None], of_other, change))


class _Split:
    """Holds the split between first and third angle where the second is near 90 degrees.

    Attributes:
        shown: (n, 3) the last angles, as held.
    """

    def __init__(self, angles: FloatArray) -> None:
        self.shown = angles
        self._held = np.zeros(len(angles))
        self._own = np.zeros(len(angles))
        self._tilt = np.arcsin(np.sin(angles[:, 1]))

    def follow(self, angles: FloatArray, parity: FloatArray, step_s: float) -> FloatArray:
        """The next angles (n, 3), held, from those of the pose.

        The difference of both rotations about the common axis is the split; their sum stays.

        Args:
            angles: (n, 3) nearest to the last.
            parity: (n,) 1 for axes in cyclic order, else -1.
            step_s: time since the last.
        """
        side = np.where(angles[:, 1] % _TURN < np.pi, parity, -parity)
        own = angles[:, 0] - side * angles[:, 2]
        gap = self.shown[:, 0] - side * self.shown[:, 2] - own
        part = np.minimum(np.abs(np.cos(angles[:, 1])) / SPLIT_COSINE, 1.0)
        weight = part * part * (3.0 - 2.0 * part)
        both = angles[:, 0] + side * angles[:, 2] - self.shown[:, 0] - side * self.shown[:, 2]
        free = np.maximum(2.0 * SPLIT_RAD_S * step_s - np.abs(both), 0.0)
        most = np.maximum(free, weight**8 * np.abs(wrapped(own - self._own)))
        held = gap + np.clip(-weight * gap, -most, most)
        held = np.where((weight == 1.0) & (self._held == 0.0), 0.0, held)
        # From one solution to the other the second angle jumps across 90 degrees.
        tilt = np.arcsin(np.sin(angles[:, 1]))
        near = _ACROSS_RAD_S * step_s + np.abs(tilt - self._tilt)
        change = angles[:, 1] - self.shown[:, 1]
        second = np.where(
            np.abs(change) <= near, angles[:, 1], self.shown[:, 1] + np.sign(change) * near
        )
        self._own, self._held, self._tilt = own, held, tilt
        self.shown = np.stack(
            [angles[:, 0] + held / 2.0, second, angles[:, 2] - side * held / 2.0], axis=1
        )
        return self.shown
