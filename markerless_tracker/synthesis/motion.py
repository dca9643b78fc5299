"""Synthetic motions: smooth periodic joint angles over a path on the floor."""

from collections.abc import Callable, Mapping

import numpy as np

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.mesh import body_mesh

Angles = Mapping[str, float]
_TURN = 2.0 * np.pi
_LEG_M = 0.84
_HEIGHT_SAMPLES = 96
_HEIGHT_HARMONICS = 4


def _bump(phase: float, centre: float, sharpness: float) -> float:
    """A periodic bump of height 1 at a phase."""
    return float(np.exp(sharpness * (np.cos(_TURN * (phase - centre)) - 1.0)))


def _stride(phase: float, swing: float, lift: float, arm: float, elbow: float) -> Angles:
    """One stride, left heel down at phase 0; anatomical angles: flexion and bending positive."""
    angles = {}
    for side, p in (("l", phase), ("r", phase + 0.5)):
        angles[f"{side}_hip_y"] = 0.06 + swing * np.cos(_TURN * p)
        angles[f"{side}_knee"] = 0.12 + lift * _bump(p, 0.72, 2.0)
        angles[f"{side}_shoulder_y"] = -arm * np.cos(_TURN * p)
        angles[f"{side}_shoulder_x"] = 0.06
        angles[f"{side}_elbow"] = elbow - 0.4 * arm * np.cos(_TURN * p)
    angles["thorax_z"] = 0.10 * np.cos(_TURN * phase)
    angles["thorax_y"] = 0.05 + 0.01 * np.cos(2.0 * _TURN * phase)
    angles["head_z"] = -0.06 * np.cos(_TURN * phase)
    angles["pelvis_rz"] = -0.06 * np.cos(_TURN * phase)
    angles["pelvis_rx"] = 0.03 * np.sin(_TURN * phase)
    return angles


def _walk(phase: float) -> Angles:
    return _stride(phase, 0.36, 0.75, 0.30, 0.40)


def _jog(phase: float) -> Angles:
    return {**_stride(phase, 0.50, 1.35, 0.45, 1.40), "pelvis_ry": 0.08}


def _balance(phase: float) -> Angles:
    slow, quick = np.sin(_TURN * phase), np.sin(2.0 * _TURN * phase + 0.7)
    return {
        "pelvis_rx": 0.06 * slow, "pelvis_ry": 0.05 + 0.03 * quick,
        "l_hip_x": -0.06 * slow, "l_hip_y": 0.12 + 0.04 * quick, "l_knee": 0.14 + 0.08 * quick,
        "r_hip_x": -0.12 + 0.05 * slow, "r_hip_y": 0.55 + 0.18 * quick,
        "r_knee": 0.80 + 0.25 * slow,
        "l_shoulder_x": 1.10 - 0.18 * slow, "r_shoulder_x": 1.10 + 0.18 * slow,
        "l_shoulder_y": 0.10 + 0.10 * quick, "r_shoulder_y": 0.10 - 0.10 * quick,
        "l_elbow": 0.35 + 0.12 * quick, "r_elbow": 0.35 - 0.12 * quick,
        "thorax_y": 0.08 + 0.03 * quick, "thorax_z": 0.12 * slow,
        "head_y": -0.10, "head_z": -0.10 * slow,
    }  # fmt: skip


def _stand(phase: float) -> Angles:
    slow, quick = np.sin(_TURN * phase), np.sin(2.0 * _TURN * phase)
    return {
        "pelvis_rx": 0.02 * slow, "pelvis_ry": 0.02 * quick,
        "l_hip_x": 0.02 - 0.02 * slow, "r_hip_x": -0.02 - 0.02 * slow,
        "l_hip_y": 0.08 + 0.02 * quick, "r_hip_y": 0.08 + 0.02 * quick,
        "l_knee": 0.10, "r_knee": 0.10,
        "l_shoulder_x": 0.08 + 0.03 * slow, "r_shoulder_x": 0.08 - 0.03 * slow,
        "l_shoulder_y": 0.10 * slow, "r_shoulder_y": -0.10 * slow,
        "l_elbow": 0.25 + 0.10 * slow, "r_elbow": 0.25 - 0.10 * slow,
        "thorax_y": 0.04, "thorax_z": 0.08 * slow, "head_z": 0.20 * slow, "head_y": -0.05,
    }  # fmt: skip


Course = tuple[Callable[[float], Angles], float, float, float, tuple[str, ...]]
"""Angles by phase, periods per second, radius of the circle walked (m), metres per period,
markers that stay over one point of the floor."""

_MOTIONS: Mapping[str, Course] = {
    "walk": (_walk, 0.66, 0.90, 4.0 * _LEG_M * np.sin(0.36), ()),
    "jog": (_jog, 1.15, 1.20, 4.0 * _LEG_M * np.sin(0.50), ()),
    "balance": (_balance, 0.40, 0.0, 0.0, ("LAnkle",)),
    "stand": (_stand, 0.25, 0.0, 0.0, ("LAnkle", "RAnkle")),
}

MOTIONS = tuple(_MOTIONS)
"""Names of the motions."""


class Motion:
    """A motion of one body: a smooth function of time, deterministic by its seed.

    Walking and jogging go round a circle about the origin. Angles are added to the neutral pose;
    joints that the body lacks are left out. The pelvis' height puts the lowest point of the body
    on the floor z = 0, smoothed over the period (within 2 cm when walking, balancing, standing).

    Args:
        body: the body that moves.
        kind: one of `MOTIONS`.
        seed: varies heading, phase and, by some percent, amplitude and tempo.

    Raises:
        ConfigError: the motion is unknown.
    """

    courses: Mapping[str, Course] = _MOTIONS
    """The available motions."""

    def __init__(self, body: BodyModel, kind: str, seed: int = 0) -> None:
        if kind not in self.courses:
            raise ConfigError(f"motion is {kind!r}, expected one of {', '.join(self.courses)}")
        self.body = body
        self.kind = kind
        self._angles, frequency, self._radius_m, self._stride_m, self._anchors = self.courses[kind]
        rng = np.random.default_rng([seed, 2])
        self._frequency_hz = frequency * rng.uniform(0.94, 1.0)
        self._amplitude = rng.uniform(*self._amplitudes(kind))
        self._phase, self._heading = rng.uniform(0.0, 1.0), rng.uniform(-np.pi, np.pi)
        scale = _leg_m(body) / _LEG_M
        self._radius_m *= scale
        self._stride_m *= scale
        self._height = self._solve_height()

    def pose(self, time_s: float) -> FloatArray:
        """The pose (p,) at a time in s."""
        phase = self._phase + self._frequency_hz * time_s
        pose = self._posture(phase)
        body = self.body
        tx, ty, tz, rz = (body.index(f"pelvis_{name}") for name in ("tx", "ty", "tz", "rz"))
        heading = self._heading
        if self._radius_m > 0.0:
            heading += self._stride_m / self._radius_m * self._frequency_hz * time_s
            pose[tx], pose[ty] = self._radius_m * np.sin(heading), -self._radius_m * np.cos(heading)
        pose[rz] += heading
        pose[tz] = self._height_at(phase)
        if self._anchors:
            rows = [MARKER_NAMES.index(name) for name in self._anchors]
            pose[[tx, ty]] -= markers(body, pose)[rows, :2].mean(axis=0)
        return pose

    def _posture(self, phase: float) -> FloatArray:
        """The pose at the origin with heading 0 and height 0."""
        angles = self._angles(phase)
        return posture(self.body, {n: self._amplitude * angle for n, angle in angles.items()})

    def _amplitudes(self, kind: str) -> tuple[float, float]:
        """Least and largest factor of all angles."""
        return 0.94, 1.0

    def _lowest_m(self) -> Callable[[FloatArray], float]:
        """Height of the body's lowest point by pose (p,)."""
        mesh = body_mesh(self.body)
        return lambda pose: float(mesh.posed(self.body, pose)[0][:, 2].min())

    def _solve_height(self) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
        """Fourier coefficients of the pelvis' height that keeps the feet on the floor."""
        lowest = self._lowest_m()
        heights = [-lowest(self._posture(i / _HEIGHT_SAMPLES)) for i in range(_HEIGHT_SAMPLES)]
        return np.fft.rfft(heights)[: _HEIGHT_HARMONICS + 1] / _HEIGHT_SAMPLES

    def _height_at(self, phase: float) -> float:
        turns = np.exp(1j * _TURN * phase * np.arange(len(self._height)))
        weights = np.where(np.arange(len(self._height)) == 0, 1.0, 2.0)
        return float((weights * self._height * turns).real.sum())


def _leg_m(body: BodyModel) -> float:
    rows = markers(body, body.neutral)
    hip, ankle = (rows[MARKER_NAMES.index(name)] for name in ("LHip", "LAnkle"))
    return float(np.linalg.norm(hip - ankle))
