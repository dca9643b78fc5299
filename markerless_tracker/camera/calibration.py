"""Calibration files: `calibration.toml` (as Pose2Sim and Anipose write it) and Qualisys.

A `calibration.toml` holds one table per camera: `name`, `size` [w, h] px (floats allowed),
`matrix` K, `distortions` [k1 k2 p1 p2 (k3)], `rotation` (Rodrigues vector, world to camera),
`translation` (m) and `fisheye`. Tables without `matrix` (`[metadata]`) are not cameras.
"""

import math
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.camera.model import CameraModel, CameraRig
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import (
    FloatArray,
    rodrigues_from_rotation,
    rotation_from_rodrigues,
    transform,
)

_MOST_PX = 65535
"""Largest width and height of an image: more than any camera has."""
# Qualisys stores focal lengths and principal points in 1/64 px.
QCA_SUBPIXELS = 64.0


def read_calibration(path: str | Path) -> CameraRig:
    """Read a `calibration.toml`; cameras keep the order of the file.

    Raises:
        CalibrationError: the file cannot be read, a camera lacks a key or has a value of the wrong
            shape, two cameras have one name, or a camera is a fisheye (not supported).
    """
    path = Path(path)
    try:
        tables = tomllib.loads(_read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise CalibrationError(f"{path}: not a TOML file: {error}") from error
    cameras = [
        _camera_from_table(path, key, table)
        for key, table in tables.items()
        if isinstance(table, dict) and "matrix" in table
    ]
    return _rig(path, cameras)


def write_calibration(path: str | Path, rig: CameraRig) -> None:
    """Write a rig as `calibration.toml`.

    Numbers are written with all their digits, Rodrigues vectors with 12 decimals: a rig that came
    from such a file is read back bit for bit.

    Raises:
        CalibrationError: the file cannot be written.
    """
    path = Path(path)
    text = "\n".join(_table(camera) for camera in rig)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be written: {error.strerror}") from error


def read_qca(path: str | Path) -> CameraRig:
    """Read a Qualisys `*.qca.txt` (XML).

    Its camera looks along -z with y up: R = diag(1, -1, -1) r, t = -R C, with C the camera's
    position in mm. Distortion coefficients are taken unchanged from the file.

    Raises:
        CalibrationError: the file cannot be read, is not XML, holds no camera or lacks an
            attribute.
    """
    path = Path(path)
    try:
        root = ElementTree.fromstring(_read_text(path))
    except ElementTree.ParseError as error:
        raise CalibrationError(f"{path}: not a Qualisys calibration (XML): {error}") from error
    return _rig(path, [_camera_from_qca(path, element) for element in root.iter("camera")])


def _rig(path: Path, cameras: list[CameraModel]) -> CameraRig:
    if not cameras:
        raise CalibrationError(f"{path}: no camera, expected a table or element with its matrix")
    try:
        return CameraRig(tuple(cameras))
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from error


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file: {error.reason}") from error


def _camera_from_table(path: Path, key: str, table: Mapping[str, Any]) -> CameraModel:
    name = table.get("name", key)
    if not isinstance(name, str) or not name:
        raise CalibrationError(f"{path}: {key}: name is {name!r}, expected a string")
    where = f"{path}: {name}"
    if table.get("fisheye", False):
        raise CalibrationError(
            f"{where}: fisheye lenses are not supported, expected fisheye = false"
        )
    rotation = rotation_from_rodrigues(_canonical(_numbers(where, table, "rotation", (3,))))
    try:
        return CameraModel(
            name=name,
            size_px=_size(where, _numbers(where, table, "size", (2,))),
            matrix=_numbers(where, table, "matrix", (3, 3)),
            distortion=_numbers(where, table, "distortions", (4,), (5,)),
            T_cam_world=transform(rotation, _numbers(where, table, "translation", (3,))),
        )
    except CalibrationError as error:
        raise _located(path, where, error) from error


def _located(path: Path, where: str, error: CalibrationError) -> CalibrationError:
    message = str(error)
    return error if message.startswith(where) else CalibrationError(f"{path}: {message}")


def _numbers(
    where: str, table: Mapping[str, Any], key: str, *shapes: tuple[int, ...]
) -> FloatArray:
    expected = " or ".join("x".join(map(str, shape)) for shape in shapes)
    if key not in table:
        raise CalibrationError(f"{where}: {key} is missing, expected {expected} numbers")
    try:
        value = np.array(table[key], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        value = np.empty(0)
    if value.shape not in shapes or not np.isfinite(value).all():
        raise CalibrationError(
            f"{where}: {key} is {table[key]!r}, expected {expected} finite numbers"
        )
    return value


def _size(where: str, size: FloatArray) -> tuple[int, int]:
    width, height = (round(float(value)) for value in size)
    if not (1 <= width <= _MOST_PX and 1 <= height <= _MOST_PX):
        raise CalibrationError(
            f"{where}: size is {size.tolist()}, expected [width, height], 1 to {_MOST_PX} px each"
        )
    return width, height


def _table(camera: CameraModel) -> str:
    # repr is the shortest text that reads back as the same float.
    def text(array: Any) -> str:
        return repr(np.asarray(array, dtype=np.float64).tolist())

    coefficients = camera.distortion if camera.distortion[4] != 0.0 else camera.distortion[:4]
    name = "".join(_escape(character) for character in camera.name)
    return "\n".join(
        [
            f'["{name}"]' if not _is_bare(camera.name) else f"[{name}]",
            f'name = "{name}"',
            f"size = [{camera.size_px[0]}, {camera.size_px[1]}]",
            f"matrix = {text(camera.matrix)}",
            f"distortions = {text(coefficients)}",
            f"rotation = {text(_canonical(rodrigues_from_rotation(camera.T_cam_world[:3, :3])))}",
            f"translation = {text(camera.T_cam_world[:3, 3])}",
            "fisheye = false",
            "",
        ]
    )


def _canonical(vector: FloatArray) -> FloatArray:
    """The Rodrigues vector (3,) of the same rotation, shorter than pi and with 12 decimals.

    Vector -> matrix -> vector is not exact in floating point. On this grid it is: a rig read,
    written and read again has the same bits. Rounding rotates a ray by less than 1e-12 rad, at
    rotations by pi by less than 1e-8 rad.
    """
    short = rodrigues_from_rotation(rotation_from_rodrigues(vector))
    length = float(np.linalg.norm(short))
    if length > math.pi - 1e-9:  # beyond pi, reading would give the opposite vector
        short = short * ((math.pi - 2e-9) / length)
    rounded: FloatArray = np.round(short, 12) + 0.0
    return rounded


def _rotation(where: str, matrix: FloatArray) -> FloatArray:
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-4 or np.linalg.det(matrix) < 0.0:
        raise CalibrationError(f"{where}: r11..r33 is not a rotation matrix")
    return rotation_from_rodrigues(_canonical(rodrigues_from_rotation(matrix)))


def _is_bare(name: str) -> bool:
    return name.isascii() and all(c.isalnum() or c in "_-" for c in name)


def _escape(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    if ord(character) < 0x20 or ord(character) == 0x7F:
        return f"\\u{ord(character):04x}"
    return character


def _camera_from_qca(path: Path, element: ElementTree.Element) -> CameraModel:
    name = element.get("serial") or ""
    where = f"{path}: {name or 'camera without serial'}"
    pose, lens = element.find("transform"), element.find("intrinsic")
    video = element.find("fov_video_max")
    if not name or pose is None or lens is None or video is None:
        raise CalibrationError(
            f"{where}: expected a serial and the elements transform, intrinsic and fov_video_max"
        )

    def number(source: ElementTree.Element, key: str) -> float:
        text = source.get(key)
        try:
            value = float(text if text is not None else "")
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise CalibrationError(f"{where}: {source.tag} {key} is {text!r}, expected a number")
        return value

    focal_u, focal_v, centre_u, centre_v, skew = (
        number(lens, key) / QCA_SUBPIXELS
        for key in ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV", "skew")
    )
    stored = np.array([[number(pose, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])
    rotation = _rotation(where, np.diag([1.0, -1.0, -1.0]) @ stored)
    position_m = np.array([number(pose, key) for key in "xyz"]) / 1000.0
    coefficients = [
        number(lens, key)
        for key in (
            "radialDistortion1",
            "radialDistortion2",
            "tangentalDistortion1",
            "tangentalDistortion2",
            "radialDistortion3",
        )
    ]
    size = np.array(
        [
            number(video, "right") - number(video, "left") + 1.0,
            number(video, "bottom") - number(video, "top") + 1.0,
        ]
    )
    try:
        return CameraModel(
            name=name,
            size_px=_size(where, size),
            matrix=np.array([[focal_u, skew, centre_u], [0.0, focal_v, centre_v], [0.0, 0.0, 1.0]]),
            distortion=np.array(coefficients),
            T_cam_world=transform(rotation, -rotation @ position_m),
        )
    except CalibrationError as error:
        raise _located(path, where, error) from error
