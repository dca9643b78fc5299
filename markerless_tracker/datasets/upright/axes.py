"""The world of a recording turned upright, in metres: an axis of the source becomes z."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray, transform

UNITS: Mapping[str, float] = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001})
"""Metres per unit of length."""

_ROTATIONS: Mapping[str, list[list[int]]] = MappingProxyType(
    {
        # Rows: the axes of the new world in those of the old one.
        "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
        "y": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        "-x": [[0, 1, 0], [0, 0, -1], [-1, 0, 0]],
    }
)
AXES = tuple(_ROTATIONS)
"""What may be up: an axis of the source's world."""


def upright(rig: CameraRig, *, up: str = "z", units: str = "m") -> CameraRig:
    """A rig in a world whose z is an axis of the old world, with lengths in m.

    Args:
        rig: its translations are in `units`.
        up: the axis of the old world that is up, one of `AXES`.
        units: of the old world, one of `UNITS`.

    Raises:
        ConfigError: an unknown axis or unit.
    """
    if up not in _ROTATIONS:
        raise ConfigError(f"up {up!r}: expected one of {', '.join(AXES)}")
    if units not in UNITS:
        raise ConfigError(f"units {units!r}: expected one of {', '.join(UNITS)}")
    if up == "z" and units == "m":
        return rig
    rotation = rotation_to(up)
    cameras = []
    for camera in rig:
        old = camera.T_cam_world
        new = transform(old[:3, :3] @ rotation.T, old[:3, 3] * UNITS[units])
        cameras.append(
            CameraModel(camera.name, camera.size_px, camera.matrix, camera.distortion, new)
        )
    return CameraRig(tuple(cameras))


def upright_points(points: FloatArray, *, up: str = "z", units: str = "m") -> FloatArray:
    """Points (..., 3) of the old world, in `units`, as points of the new world, in m.

    Other arguments as in `upright`.
    """
    return np.asarray(points @ rotation_to(up).T * UNITS[units])


def rotation_to(up: str) -> FloatArray:
    """(3, 3) rotation that takes the old world to the new one, in which the axis `up` is z."""
    return np.array(_ROTATIONS[up], dtype=np.float64)
