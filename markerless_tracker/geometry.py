"""Rigid transforms as 4x4 matrices. ``T_a_b`` takes points given in frame b to frame a."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def rotation_from_rodrigues(vector: Any) -> FloatArray:
    """Rotation matrix (3, 3) of a Rodrigues vector (3,), in rad."""
    v = np.asarray(vector, dtype=np.float64).reshape(3)
    angle = float(np.linalg.norm(v))
    if angle < 1e-12:
        return np.eye(3) + skew(v)
    k = skew(v / angle)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k))


def rodrigues_from_rotation(rotation: Any) -> FloatArray:
    """Rodrigues vector (3,), in rad and at most pi long, of a rotation matrix (3, 3)."""
    w, x, y, z = quaternion_from_rotation(rotation)
    axis = np.array([x, y, z])
    length = float(np.linalg.norm(axis))
    if length < 1e-12:
        return np.asarray(2.0 * axis)
    return np.asarray(axis / length * 2.0 * np.arctan2(length, w))


def rotation_from_euler(axes: str, angles_rad: Any) -> FloatArray:
    """Rotation matrix (3, 3) of turns about a frame's own axes, one after the other.

    Args:
        axes: ``x``, ``y`` or ``z`` for each turn; the later ones are about axes already turned.
        angles_rad: an angle for each.
    """
    # Every process needs it, and `scipy.spatial` takes a tenth of a second to import.
    rotation = np.eye(3)
    for axis, angle in zip(axes, angles_rad, strict=True):
        rotation = rotation @ rotation_from_rodrigues(float(angle) * np.eye(3)["xyz".index(axis)])
    return rotation


def skew(vector: Any) -> FloatArray:
    """Matrix (3, 3) with ``skew(a) @ b == cross(a, b)``."""
    x, y, z = np.asarray(vector, dtype=np.float64).reshape(3)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def quaternion_from_rotation(rotation: Any) -> FloatArray:
    """Unit quaternion (w, x, y, z) with w >= 0 of a rotation matrix (3, 3)."""
    r = np.asarray(rotation, dtype=np.float64).reshape(3, 3)
    # The largest of the four squared components keeps the division well conditioned.
    squares = np.array(
        [
            1.0 + r[0, 0] + r[1, 1] + r[2, 2],
            1.0 + r[0, 0] - r[1, 1] - r[2, 2],
            1.0 - r[0, 0] + r[1, 1] - r[2, 2],
            1.0 - r[0, 0] - r[1, 1] + r[2, 2],
        ]
    )
    best = int(np.argmax(squares))
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    d, e, f = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
    rows = np.array([[0.0, a, b, c], [a, 0.0, d, e], [b, d, 0.0, f], [c, e, f, 0.0]])
    q = (rows + np.diag(squares))[best] / (2.0 * np.sqrt(squares[best]))
    return np.asarray(-q if q[0] < 0.0 else q)


def rotation_from_quaternion(quaternion: Any) -> FloatArray:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z) of any non-zero length."""
    q = np.asarray(quaternion, dtype=np.float64).reshape(4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def roll_pitch_yaw(rotation: Any) -> FloatArray:
    """Angles (3,) rad about the fixed axes x, y, z of a rotation matrix (3, 3), as URDF has them.

    R = Rz(yaw) Ry(pitch) Rx(roll); at a pitch of 90 degrees the yaw is 0.
    """
    R = np.asarray(rotation, dtype=np.float64)
    level = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], level)
    if level < 1e-9:
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])


def transform(rotation: Any, translation: Any) -> FloatArray:
    """Homogeneous matrix (4, 4) of a rotation (3, 3) and a translation (3,)."""
    t = np.eye(4)
    t[:3, :3] = rotation
    t[:3, 3] = translation
    return t


def inverse(T_a_b: FloatArray) -> FloatArray:
    """``T_b_a`` (4, 4) of a rigid ``T_a_b`` (4, 4)."""
    r = T_a_b[:3, :3].T
    return transform(r, -r @ T_a_b[:3, 3])


def apply(T_a_b: FloatArray, points_b: Any) -> FloatArray:
    """Points (..., 3) of frame b, expressed in frame a."""
    return np.asarray(points_b, dtype=np.float64) @ T_a_b[:3, :3].T + T_a_b[:3, 3]
