"""First guesses of the pose: generic postures, placed in a hull, in every heading."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from markerless_tracker.body import BodyModel, markers_of_many, transforms_of_many
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.model import MARKER_NAMES
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.evidence.hull import Hull

HEADINGS = 16
VARIATIONS = 48
"""Random variations of the postures, per heading."""
ANKLE_M = 0.08
"""Height of the lower ankle of a person that stands, squats, bends or sits."""
OFF_FLOOR_M = 0.15
"""A hull whose lowest point is higher above the floor, z = 0, may lack the feet."""
VARIATION_FRACTION = 0.6
"""Standard deviation of the variations, as a fraction of the prior's."""
_TILT_RAD = (0.35, 0.40)
"""Standard deviations of the variations' pelvis_rx and pelvis_ry."""
_HEAD = MARKER_NAMES.index("Head")
_ANKLES = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]
_LIKE_TRUNK = ("pelvis", "belly", "chest", "torso")

_LEFT_STEP = {
    "l_hip_y": 0.45, "r_hip_y": -0.20, "l_knee": 0.15, "r_knee": 0.35,
    "l_shoulder_y": -0.35, "r_shoulder_y": 0.35, "l_elbow": 0.40, "r_elbow": 0.40,
}  # fmt: skip
_LEFT_KNEE_UP = {"l_hip_y": 1.1, "l_knee": 0.9, "l_shoulder_x": 0.8, "r_shoulder_x": 0.8}
_LEFT_SWING = {"r_hip_y": 0.1, "r_knee": 0.1, "l_hip_y": 0.35, "l_knee": 1.0, "l_elbow": 0.4}


def _mirrored(angles: Mapping[str, float]) -> dict[str, float]:
    other = {"l": "r", "r": "l"}
    return {other[name[0]] + name[1:]: angle for name, angle in angles.items()}


def _both(**angles: float) -> dict[str, float]:
    """Angles of both sides."""
    return {f"{side}_{name}": angle for side in "lr" for name, angle in angles.items()}


POSTURES: tuple[Mapping[str, float], ...] = (
    {},
    _LEFT_STEP,
    _mirrored(_LEFT_STEP),
    _LEFT_SWING,
    _mirrored(_LEFT_SWING),
    {"l_shoulder_x": 1.2, "r_shoulder_x": 1.2, "l_elbow": 0.2, "r_elbow": 0.2},
    {"l_shoulder_y": 1.0, "r_shoulder_y": 1.0, "l_elbow": 0.6, "r_elbow": 0.6},
    {"l_shoulder_x": 2.2, "r_shoulder_x": 2.2, "l_elbow": 0.6, "r_elbow": 0.6},
    _LEFT_KNEE_UP,
    _mirrored(_LEFT_KNEE_UP),
    {
        "pelvis_ry": 0.8, "l_hip_y": 0.8, "r_hip_y": 0.8, "l_knee": 0.2, "r_knee": 0.2,
        "l_shoulder_y": 0.8, "r_shoulder_y": 0.8,
    },
    {"l_hip_y": 1.2, "r_hip_y": 1.2, "l_knee": 1.6, "r_knee": 1.6, "pelvis_ry": 0.3},
    _both(hip_y=2.0, knee=2.2, shoulder_y=1.0, elbow=0.5) | {"pelvis_ry": 0.4, "thorax_y": 0.4},
    _both(hip_y=1.5, knee=1.5, shoulder_y=0.4, elbow=0.8),
    _both(hip_y=1.1, knee=0.2, shoulder_y=1.5, elbow=0.2) | {"pelvis_ry": 1.1, "thorax_y": 0.6},
    _both(hip_y=1.3, knee=0.3, shoulder_y=2.0, elbow=0.2) | {"pelvis_ry": 1.3, "thorax_y": 0.3},
    _both(shoulder_y=2.8, elbow=0.3),
    _both(shoulder_y=0.5, elbow=1.5) | {"l_shoulder_z": 1.3, "r_shoulder_z": -1.3},
)  # fmt: skip
"""Anatomical angles (rad): standing, steps, swinging legs, raised arms, raised knees, a bow, a
squat, a deep squat, sitting, bending down, arms overhead, crossed arms."""


@dataclass(frozen=True)
class _Joints:
    """What postures depend on: a body's joints, whatever its sizes."""

    body: BodyModel = field(compare=False)
    name: str
    neutral: bytes
    axes: bytes


def postures(body: BodyModel) -> FloatArray:
    """The postures (k, p) at the origin, facing along x; not to be changed.

    They are made once for all sizes of a body, of which a start tries many.
    """
    axes = body.node_fixed[:, :, :3].tobytes() + body.node_sign.tobytes()
    return _made(_Joints(body, body.name, body.neutral.tobytes(), axes))


@lru_cache(maxsize=4)
def _made(joints: _Joints) -> FloatArray:
    return np.array([posture(joints.body, angles) for angles in POSTURES])


def joint_sd(body: BodyModel) -> FloatArray:
    """(p,) standard deviations of the pose prior, rad; 0 for the root."""
    return np.where(np.isfinite(body.prior_sd), body.prior_sd, 0.0)


def first_guesses(
    body: BodyModel, limits: FloatArray, hull: Hull, rng: np.random.Generator
) -> FloatArray:
    """Poses (`HEADINGS`, n, p): postures and variations of them, in every heading.

    Args:
        body: the body.
        limits: (2, p) of the poses.
        hull: the trunk is placed at the hull's trunk. Its height is that of the hull's trunk, or
            puts the lower ankle at one of `ankle_heights_m`. The postures are also placed with the
            head at the hull's top.
        rng: draws the variations.
    """
    known = postures(body)
    sd = VARIATION_FRACTION * joint_sd(body)
    sd[[body.index("pelvis_rx"), body.index("pelvis_ry")]] = _TILT_RAD
    heights = ankle_heights_m(hull)
    places = 1 + len(heights)
    count = (places + 1) * len(known) + VARIATIONS
    out = np.empty((HEADINGS, count, body.size))
    for k in range(HEADINGS):
        varied = known[rng.integers(len(known), size=VARIATIONS)]
        varied = varied + sd * rng.standard_normal((VARIATIONS, body.size))
        out[k] = np.concatenate([*[known] * places, varied, known])
        out[k, :, body.index("pelvis_rz")] += 2.0 * np.pi * k / HEADINGS
    np.clip(out, limits[0], limits[1], out=out)
    at = body.root_position
    flat = out.reshape(-1, body.size)
    middles = _trunk_middles(body, flat).reshape(HEADINGS, -1, 3)
    ankles = markers_of_many(body, flat)[:, _ANKLES, 2].min(axis=1).reshape(HEADINGS, -1)
    out[..., at] += hull.trunk_m.mean(axis=0) - middles
    # The height of the hull's trunk varies by 0.3 m with clothes and arms; that of the feet is
    # sure.
    shift = hull.trunk_m[:, 2].mean() - middles[..., 2]
    place = np.concatenate(
        [np.repeat(np.arange(places), len(known)), np.arange(VARIATIONS) % places]
    )
    for number, height in enumerate(heights):
        rows = np.flatnonzero(place == 1 + number)
        out[:, rows, at[2]] += height - ankles[:, rows] - shift[:, rows]
    # The lap of a seated person, or a skirt, may be thicker than the trunk.
    last = out[:, -len(known) :]
    heads = markers_of_many(body, last.reshape(-1, body.size))[:, _HEAD]
    last[..., at] += hull.top_m - heads.reshape(HEADINGS, -1, 3)
    return out


def ankle_heights_m(hull: Hull) -> tuple[float, ...]:
    """Possible heights of the lower ankle, m: from the hull's lowest point, and from the floor."""
    low = max(hull.low_m, 0.0)
    return (low + ANKLE_M,) if low <= OFF_FLOOR_M else (low + ANKLE_M, ANKLE_M)


def put_at(body: BodyModel, hull: Hull, pose: FloatArray) -> FloatArray:
    """A pose (p,) with its trunk moved to the hull's trunk."""
    moved = pose.copy()
    at = body.root_position
    moved[at] += hull.trunk_m.mean(axis=0) - _trunk_middles(body, pose[None])[0]
    return moved


def _trunk_middles(body: BodyModel, poses: FloatArray) -> FloatArray:
    """Middle (n, 3) of the trunk's cones at poses (n, p), m."""
    named = [i for i, name in enumerate(body.cone_names) if name in _LIKE_TRUNK]
    cones = np.array(named or range(len(body.cone_names)))
    fixed = body.cone_fixed[cones]
    middle = fixed[:, :, 3] + 0.5 * body.cone_length[cones, None] * fixed[:, :, 2]
    nodes = transforms_of_many(body, poses)[:, body.cone_node[cones]]
    placed = np.matmul(nodes[..., :3], middle[:, :, None])[..., 0] + nodes[..., 3]
    return np.asarray(placed.mean(axis=1))
