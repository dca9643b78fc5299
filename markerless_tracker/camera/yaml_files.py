"""Calibrations as YAML: OpenCV's FileStorage (also XML and JSON) and ROS' camera_calibration.

One file per camera, or all in `intri.yml` and `extri.yml` as EasyMocap writes them.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from markerless_tracker.camera.model import CameraModel, CameraRig
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import (
    FloatArray,
    inverse,
    rotation_from_quaternion,
    rotation_from_rodrigues,
    transform,
)

EXTRINSICS = "extrinsics.yaml"
"""Poses of cameras whose own files have none: camera -> `translation` and `rotation`."""
_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M")
_DISTORTION = (
    "distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "dist_coeffs", "D",
)  # fmt: skip
_ROTATION = ("R", "rotation_matrix", "rvec", "Rot")
_TRANSLATION = ("T", "t", "tvec", "translation_vector")
_WHOLE = ("extrinsic_matrix", "T_cam_world", "extrinsics")
_PLUMB_BOB = ("plumb_bob", "rational_polynomial")


def read_camera(
    path: str | Path, name: str, size_px: tuple[int, int], pose: FloatArray | None = None
) -> CameraModel:
    """Read the file of one camera.

    Intrinsics: `camera_matrix`, `distortion_coefficients` and, if stated, `image_width` and
    `image_height`, as OpenCV's and ROS' calibration tools write them. Pose: `R` (matrix or vector)
    or `rvec`, and `T` or `tvec`, world to camera in m, or `extrinsic_matrix` (3 or 4 rows).

    Args:
        path: the file.
        name: of the camera.
        size_px: (width, height) of its images.
        pose: T_cam_world (4, 4) for a file that has none.

    Raises:
        CalibrationError: a file or field is missing or malformed, or states another size.
    """
    path = Path(path)
    fields = _fields(path)
    width, height = (_number(path, fields, f"image_{side}") for side in ("width", "height"))
    for side, stated, own_px in zip("width height".split(), (width, height), size_px, strict=True):
        if stated is not None and round(stated) != own_px:
            raise CalibrationError(
                f"{path}: image_{side} is {stated:g}, expected {own_px} as the images of {name}"
            )
    model = fields("distortion_model")
    if isinstance(model, str) and model not in _PLUMB_BOB:
        raise CalibrationError(
            f"{path}: distortion_model is {model!r}, expected {' or '.join(_PLUMB_BOB)}"
        )
    matrix = _array(path, fields, _MATRIX, (3, 3))
    distortion = _array(path, fields, _DISTORTION, (4,), (5,), (8,), (12,), (14,))
    own = _pose(path, fields)
    if own is None and pose is None:
        raise CalibrationError(
            f"{path}: no pose, expected R and T (world to camera, m), or {name} in {EXTRINSICS}"
        )
    return _camera(path, name, size_px, matrix, distortion, own if own is not None else pose)


def read_pair(
    intrinsics: str | Path, extrinsics: str | Path, sizes_px: Mapping[str, tuple[int, int]]
) -> CameraRig:
    """Read `intri.yml` (K_NAME, dist_NAME) and `extri.yml` (Rot_NAME or R_NAME, T_NAME; m).

    Args:
        intrinsics: the file of the lenses.
        extrinsics: the file of the poses, world to camera.
        sizes_px: camera -> (width, height) of its images; these cameras are read.

    Raises:
        CalibrationError: a file or field is missing or malformed; names both.
    """
    inner, outer = Path(intrinsics), Path(extrinsics)
    lenses, poses = _fields(inner), _fields(outer)
    cameras = []
    for name, size_px in sizes_px.items():
        rotation = _array(outer, poses, (f"Rot_{name}", f"R_{name}"), (3, 3), (3,))
        translation = _array(outer, poses, (f"T_{name}",), (3,))
        pose = _transform(outer, rotation, translation)
        matrix = _array(inner, lenses, (f"K_{name}",), (3, 3))
        distortion = _array(inner, lenses, (f"dist_{name}", f"D_{name}"), (4,), (5,))
        cameras.append(_camera(inner, name, size_px, matrix, distortion, pose))
    return CameraRig(tuple(cameras))


def read_extrinsics(path: str | Path) -> dict[str, FloatArray]:
    """Camera -> T_cam_world (4, 4) of a file of poses in the world, as ROS' static transforms.

    For each camera `translation: {x, y, z}` in m and `rotation: {x, y, z, w}`: the pose of its
    optical frame in the world.

    Raises:
        CalibrationError: the file cannot be read, or a field is missing or no number.
    """
    path = Path(path)
    loaded = _loaded(path)
    poses = {}
    for name, entry in loaded.items():
        try:
            t, q = entry["translation"], entry["rotation"]
            translation = [float(t[axis]) for axis in "xyz"]
            quaternion = np.array([float(q[axis]) for axis in "wxyz"])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise CalibrationError(
                f"{path}: {name}: expected translation x, y, z and rotation x, y, z, w ({error})"
            ) from error
        length = float(np.linalg.norm(quaternion))
        if not np.isfinite(translation).all():
            raise CalibrationError(
                f"{path}: {name}: translation is {translation}, expected finite numbers"
            )
        if not 0.99 < length < 1.01:
            raise CalibrationError(f"{path}: {name}: rotation is no unit quaternion")
        T_world_cam = transform(rotation_from_quaternion(quaternion / length), translation)
        poses[str(name)] = inverse(T_world_cam)
    return poses


_Fields = Callable[[str], Any]
"""The value of a field by its name: array, number, text or None."""


def _fields(path: Path) -> _Fields:
    text = _text(path)
    if "opencv-matrix" in text or text.startswith(("%YAML", "<?xml")):
        try:
            storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)
        except (cv2.error, SystemError) as error:
            raise CalibrationError(f"{path}: cannot be read by OpenCV") from error
        if not storage.isOpened():
            raise CalibrationError(f"{path}: cannot be read by OpenCV")
        return lambda name: _of_node(path, name, storage.getNode(name))
    loaded = _loaded(path)

    def field(name: str) -> Any:
        value: Any = loaded.get(name)
        if isinstance(value, dict) and "data" in value:
            rows, columns = value.get("rows", -1), value.get("cols", 1)
            try:
                return np.array(value["data"], dtype=np.float64).reshape(int(rows), int(columns))
            except (TypeError, ValueError, OverflowError) as error:
                raise CalibrationError(
                    f"{path}: {name}: data is {value['data']!r}, expected {rows}x{columns} numbers"
                ) from error
        return value

    return field


def _of_node(path: Path, name: str, node: Any) -> Any:
    try:
        if node.isNone():
            return None
        if node.isString():
            return node.string()
        if node.isReal() or node.isInt():
            return node.real()
        if node.isSeq():
            return np.array([node.at(index).real() for index in range(node.size())])
        _check_size(path, name, node)
        return node.mat()
    except (cv2.error, SystemError) as error:
        raise CalibrationError(f"{path}: {name} cannot be read by OpenCV") from error


def _check_size(path: Path, name: str, node: Any) -> None:
    """Make sure that a matrix has the numbers that it states: other sizes crash OpenCV."""
    sizes = node.getNode("sizes")
    # OpenCV 5 writes vectors with `sizes`, matrices with `rows` and `cols`.
    nodes = [node.getNode(side) for side in ("rows", "cols")]
    if not sizes.isNone():
        nodes = [sizes.at(n) for n in range(sizes.size())] if sizes.isSeq() else [sizes]
    sides = [int(side.real()) if side.isInt() else 0 for side in nodes]
    data = node.getNode("data")
    count = data.size() if data.isSeq() else math.prod(sides)
    if min(sides, default=0) < 1 or math.prod(sides) != count:
        stated = "rows and cols are" if sizes.isNone() else "sizes are"
        raise CalibrationError(
            f"{path}: {name}: {stated} {' and '.join(map(str, sides))}, data has {count} values, "
            "expected their product"
        )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file: {error.reason}") from error


def _loaded(path: Path) -> dict[str, Any]:
    try:
        loaded = yaml.safe_load(_text(path))
    except (yaml.YAMLError, RecursionError) as error:
        raise CalibrationError(f"{path}: not a YAML file: {str(error).splitlines()[0]}") from error
    if not isinstance(loaded, dict):
        raise CalibrationError(f"{path}: expected a mapping, got {type(loaded).__name__}")
    return loaded


def _number(path: Path, fields: _Fields, name: str) -> float | None:
    value = fields(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CalibrationError(f"{path}: {name} is {value!r}, expected a finite number")
    return float(value)


def _array(
    path: Path, fields: _Fields, names: tuple[str, ...], *shapes: tuple[int, ...]
) -> FloatArray:
    """The first field of some names, in one of some shapes; a row or column is a vector."""
    found = next(((n, v) for n in names if (v := fields(n)) is not None), None)
    expected = " or ".join("x".join(map(str, shape)) for shape in shapes)
    if found is None:
        raise CalibrationError(f"{path}: no {names[0]}, expected {expected} numbers")
    try:
        value = np.array(found[1], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        value = np.empty(0)
    if value.shape not in shapes and 1 in value.shape:
        value = value.ravel()
    if value.shape in shapes and not np.isfinite(value).all():
        raise CalibrationError(f"{path}: {found[0]} is {value.tolist()}, expected finite numbers")
    if value.shape not in shapes:
        raise CalibrationError(
            f"{path}: {found[0]} has shape {'x'.join(map(str, value.shape))}, expected {expected} "
            "finite numbers"
        )
    return value


def _pose(path: Path, fields: _Fields) -> FloatArray | None:
    """T_cam_world (4, 4) of a file that has it."""
    if any(fields(name) is not None for name in _WHOLE):
        whole = _array(path, fields, _WHOLE, (4, 4), (3, 4))
        return _transform(path, whole[:3, :3], whole[:3, 3])
    if all(fields(name) is None for name in (*_ROTATION, *_TRANSLATION)):
        return None
    rotation = _array(path, fields, _ROTATION, (3, 3), (3,))
    return _transform(path, rotation, _array(path, fields, _TRANSLATION, (3,)))


def _transform(path: Path, rotation: FloatArray, translation: FloatArray) -> FloatArray:
    matrix = rotation_from_rodrigues(rotation) if rotation.size == 3 else rotation
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-3:
        raise CalibrationError(f"{path}: R is not a rotation matrix")
    return transform(matrix, translation)


def _camera(
    path: Path,
    name: str,
    size_px: tuple[int, int],
    matrix: FloatArray,
    distortion: FloatArray,
    pose: FloatArray | None,
) -> CameraModel:
    if np.any(distortion[5:] != 0.0):
        raise CalibrationError(
            f"{path}: {name}: distortion has {distortion.size} coefficients, expected "
            "k1 k2 p1 p2 (k3), the others 0"
        )
    assert pose is not None
    try:
        return CameraModel(name, size_px, matrix, distortion[:5], pose)
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from error
