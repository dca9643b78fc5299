"""Calibrations `.cal` of HumanEva and bodytrack: the numbers of one camera (Bouguet's toolbox)."""

from itertools import permutations
from pathlib import Path

import numpy as np

from markerless_tracker.camera.model import CameraModel
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, rotation_from_rodrigues, transform

_LENS = 10
"""Numbers before the pose: fc (2), cc (2), alpha_c, kc (5)."""
_MM = 1000.0
_CLOSE = 1e-3


def read_cal(path: str | Path, name: str, size_px: tuple[int, int]) -> CameraModel:
    """Read a `.cal`: fc, cc, alpha_c, kc (k1 k2 p1 p2 k3), R row by row, T in mm.

    It holds these 22 numbers, or 25 with the rotation vector of R among the pose; R and its
    rotation vector tell in which order the pose is stored. Xc = R X + T; the skew of the pixels is
    alpha_c fc[0]. T becomes m.

    Args:
        path: the file.
        name: of the camera.
        size_px: (width, height) of its images, which the file does not state.

    Raises:
        CalibrationError: the file cannot be read, or has other numbers; names the field.
    """
    path = Path(path)
    values = _numbers(path)
    if values.size not in (22, 25):
        raise CalibrationError(
            f"{path}: {values.size} numbers, expected 22 (fc cc alpha_c kc R T) or 25 (with the "
            "rotation vector)"
        )
    fx, fy, cx, cy, alpha = values[:5].tolist()
    if fx <= 0.0 or fy <= 0.0:
        raise CalibrationError(f"{path}: fc is {fx:g} {fy:g}, expected positive focal lengths")
    rotation, translation_mm = _pose(path, values[_LENS:])
    try:
        return CameraModel(
            name=name,
            size_px=size_px,
            matrix=np.array([[fx, alpha * fx, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
            distortion=values[5:_LENS],
            T_cam_world=transform(rotation, translation_mm / _MM),
        )
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from error


def _numbers(path: Path) -> FloatArray:
    try:
        words = path.read_text(encoding="ascii").split()
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file, expected 22 or 25 numbers") from error
    try:
        values = np.array([float(word) for word in words])
    except ValueError as error:
        raise CalibrationError(f"{path}: {error}, expected 22 or 25 numbers") from error
    if not np.isfinite(values).all():
        raise CalibrationError(f"{path}: holds a number that is not finite")
    return values


def _pose(path: Path, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """R (3, 3) and T (3,) in mm from 12 numbers, or from 15 in any order."""
    if values.size == 12:
        rotation = values[:9].reshape(3, 3)
        if _is_rotation(rotation):
            return rotation, values[9:]
        raise CalibrationError(f"{path}: R (numbers 11 to 19) is not a rotation matrix")
    for order in permutations((9, 3, 3)):
        ends = np.cumsum(order)
        parts = [values[end - size : end] for end, size in zip(ends, order, strict=True)]
        rotation = next(part for part in parts if part.size == 9).reshape(3, 3)
        vectors = [part for part in parts if part.size == 3]
        if not _is_rotation(rotation):
            continue
        for vector, other in (vectors, vectors[::-1]):
            if np.abs(rotation_from_rodrigues(vector) - rotation).max() < _CLOSE:
                return rotation, other
    raise CalibrationError(
        f"{path}: numbers 11 to 25 hold no rotation matrix R with its rotation vector"
    )


def _is_rotation(matrix: FloatArray) -> bool:
    off = np.abs(matrix @ matrix.T - np.eye(3)).max()
    return bool(off < _CLOSE and np.linalg.det(matrix) > 0.0)
