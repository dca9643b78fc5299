"""A calibrated camera, and a rig of cameras (OpenCV convention: x right, y down, z forward)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera.lens import project_points
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, inverse
from markerless_tracker.records import locked

_ZERO = 1e-6
"""Largest deviation of the entries of K that are 0 or 1."""


@dataclass(frozen=True, eq=False)
class CameraModel:
    """Pinhole camera with radial-tangential distortion.

    Attributes:
        name: the camera's name, used in topics and file names.
        size_px: (width, height) of its images.
        matrix: (3, 3) K, px; the centre of the top left pixel is (0, 0).
        distortion: (5,) k1 k2 p1 p2 k3 (four or five may be given).
        T_cam_world: (4, 4) rigid, takes world points (m) to the camera's frame.

    Raises:
        CalibrationError: a value has the wrong shape, is not finite or not a rigid transform.
    """

    name: str
    size_px: tuple[int, int]
    matrix: FloatArray
    distortion: FloatArray
    T_cam_world: FloatArray

    def __post_init__(self) -> None:
        distortion = np.asarray(self.distortion, dtype=np.float64).ravel()
        if distortion.size not in (4, 5):
            raise CalibrationError(
                f"{self.name}: {distortion.size} distortion coefficients, expected k1 k2 p1 p2 (k3)"
            )
        object.__setattr__(
            self, "distortion", locked(np.resize(np.append(distortion, 0.0), 5), float)
        )
        for field, shape in (("matrix", (3, 3)), ("T_cam_world", (4, 4))):
            value = locked(getattr(self, field), float)
            if value.shape != shape or not np.isfinite(value).all():
                raise CalibrationError(
                    f"{self.name}: {field} has shape {value.shape}, expected finite {shape}"
                )
            object.__setattr__(self, field, value)
        if not np.isfinite(self.distortion).all():
            raise CalibrationError(f"{self.name}: distortion coefficients must be finite")
        if self.matrix[0, 0] <= 0 or self.matrix[1, 1] <= 0:
            raise CalibrationError(
                f"{self.name}: focal lengths must be positive, K is {self.matrix.tolist()}"
            )
        below = np.abs(self.matrix - np.eye(3))[[1, 2, 2, 2], [0, 0, 1, 2]]
        if below.max() > _ZERO:
            raise CalibrationError(
                f"{self.name}: K is {self.matrix.tolist()}, expected rows fx s cx, 0 fy cy, 0 0 1 "
                "(transposed?)"
            )
        rotation = self.T_cam_world[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0:
            raise CalibrationError(
                f"{self.name}: its rotation is {rotation.round(4).tolist()}, "
                "expected a rotation matrix"
            )
        width, height = self.size_px
        if width < 1 or height < 1:
            raise CalibrationError(f"{self.name}: image size {width}x{height}, expected positive")

    @property
    def T_world_cam(self) -> FloatArray:
        """(4, 4), takes points of the camera's frame to the world."""
        return inverse(self.T_cam_world)

    def resized(self, size_px: tuple[int, int]) -> "CameraModel":
        """The same camera with its images resized to (width, height), each axis by its own factor.

        Pixel centres lie at integers, so u' + 1/2 = (u + 1/2) * factor.
        """
        factor = np.array(size_px, dtype=np.float64) / np.array(self.size_px, dtype=np.float64)
        matrix = self.matrix.copy()
        matrix[:2] *= factor[:, None]
        matrix[:2, 2] += 0.5 * factor - 0.5
        return CameraModel(self.name, size_px, matrix, self.distortion, self.T_cam_world)

    def scaled(self, scale: float) -> "CameraModel":
        """The camera of images scaled by one factor; see `scaled_size`."""
        return self if scale == 1.0 else self.resized(scaled_size(self.size_px, scale))

    def shifted(self, px: tuple[float, float]) -> "CameraModel":
        """The camera that sees everything (u, v) px to the right and farther down."""
        matrix = self.matrix.copy()
        matrix[:2, 2] += px
        return replace(self, matrix=matrix)


@dataclass(frozen=True)
class CameraRig:
    """Cameras in a fixed order, with distinct names.

    Raises:
        CalibrationError: no camera, or two of one name.
    """

    cameras: tuple[CameraModel, ...]

    def __post_init__(self) -> None:
        if not self.cameras:
            raise CalibrationError("a rig needs at least one camera, none was given")
        if len(set(self.names)) != len(self.cameras):
            raise CalibrationError(f"camera names must be distinct, got {', '.join(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the rig's order."""
        return tuple(camera.name for camera in self.cameras)

    def __len__(self) -> int:
        return len(self.cameras)

    def __iter__(self) -> Iterator[CameraModel]:
        return iter(self.cameras)

    def __getitem__(self, name: str) -> CameraModel:
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise CalibrationError(f"no camera {name!r}, the rig has {', '.join(self.names)}")

    def scaled(self, scale: float) -> "CameraRig":
        """The rig of images scaled by one factor."""
        return CameraRig(tuple(camera.scaled(scale) for camera in self.cameras))

    def moved(self, T_new_old: FloatArray) -> "CameraRig":
        """The rig in another world, to which (4, 4) T_new_old takes the points of this one."""
        back = inverse(T_new_old)
        return CameraRig(tuple(replace(c, T_cam_world=c.T_cam_world @ back) for c in self))

    def shifted(self, shifts_px: Mapping[str, tuple[float, float]]) -> "CameraRig":
        """The rig with the images of some cameras shifted; see `CameraModel.shifted`."""
        return CameraRig(
            tuple(c.shifted(shifts_px[c.name]) if c.name in shifts_px else c for c in self)
        )

    def selected(self, names: Sequence[str]) -> "CameraRig":
        """The rig with those cameras only, in the order given."""
        return CameraRig(tuple(self[name] for name in names))


def nominal_camera(name: str, size_px: tuple[int, int]) -> CameraModel:
    """A camera of that name and size, at the origin of the world."""
    focal = 1.2 * max(size_px)
    matrix = np.array(
        [
            [focal, 0.0, 0.5 * (size_px[0] - 1)],
            [0.0, focal, 0.5 * (size_px[1] - 1)],
            [0.0, 0.0, 1.0],
        ]
    )
    return CameraModel(name, size_px, matrix, np.zeros(5), np.eye(4))


def scaled_size(size_px: tuple[int, int], scale: float) -> tuple[int, int]:
    """(width, height) of an image scaled by a factor, each at least 1."""
    return max(1, round(size_px[0] * scale)), max(1, round(size_px[1] * scale))


def project(points_world: NDArray[np.floating], rig: CameraRig) -> FloatArray:
    """Project points (n, 3) in m, world frame, through every lens of a rig.

    Returns pixels (c, n, 2) as (u, v), NaN for points that are not in front of the camera.
    """
    points = np.asarray(points_world, dtype=np.float64).reshape(-1, 3)
    return np.stack([project_camera(points, camera) for camera in rig])


def project_camera(points_world: FloatArray, camera: CameraModel) -> FloatArray:
    """Project points (n, 3) in m, world frame; returns pixels (n, 2), NaN behind the camera.

    Radial-tangential model as OpenCV and the Bouguet toolbox define it.
    """
    points = np.array(points_world, dtype=np.float64).reshape(-1, 3)
    pixels = np.empty((len(points), 2))
    project_points(points, camera.T_cam_world, camera.matrix, camera.distortion, pixels)
    return pixels
