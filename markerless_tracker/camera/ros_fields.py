"""A camera as ROS describes it, in plain numbers: fields of CameraInfo, chains of transforms.

The messages themselves are filled and read elsewhere; these functions take and give their fields.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from markerless_tracker.camera.model import CameraModel
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, rotation_from_quaternion, transform

LENS_MODEL = "plumb_bob"
"""ROS' name of the radial-tangential model with k1 k2 p1 p2 k3."""
FISHEYE_MODELS = ("equidistant", "fisheye")
"""ROS' names of lenses whose images are distorted even if all coefficients are 0."""
WORLD_FRAME = "map"
"""Frame of everything in world coordinates (REP-105)."""


def optical_frame(camera: str) -> str:
    """Frame of a camera's images (REP-103: x right, y down, z forward)."""
    return f"{camera}_optical_frame"


class CameraInfoFields(Protocol):
    """The fields of sensor_msgs/CameraInfo that are read here."""

    width: int
    height: int
    distortion_model: str
    d: Any
    k: Any
    binning_x: int
    binning_y: int
    roi: Any


def camera_info_fields(camera: CameraModel) -> dict[str, Any]:
    """Fields of a sensor_msgs/CameraInfo (REP-104) of unrectified images: R = 1, P = [K 0].

    Returns:
        `width`, `height`, `distortion_model`, and lists `d` (5), `k` (9), `r` (9) and `p` (12).
    """
    width, height = camera.size_px
    projection = np.hstack([camera.matrix, np.zeros((3, 1))])
    return {
        "width": width,
        "height": height,
        "distortion_model": LENS_MODEL,
        "d": camera.distortion.tolist(),
        "k": camera.matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": projection.ravel().tolist(),
    }


def lens_of(info: CameraInfoFields, where: str) -> tuple[FloatArray, FloatArray]:
    """K (3, 3) in px and the distortion (5,) of a sensor_msgs/CameraInfo of full images.

    Args:
        info: the message.
        where: its topic or file and camera, for messages.

    Raises:
        CalibrationError: uncalibrated (K is zero), not finite, another lens model than plumb_bob,
            binning or a region of interest.
    """
    matrix = np.array(info.k, dtype=np.float64).reshape(3, 3)
    distortion = np.array(info.d, dtype=np.float64).ravel()
    if not matrix.any():
        raise CalibrationError(f"{where}: K is zero (uncalibrated), expected a calibrated camera")
    if not (np.isfinite(matrix).all() and np.isfinite(distortion).all()):
        raise CalibrationError(f"{where}: K or D is not finite, expected numbers")
    # Polynomials without coefficients are no distortion; a fisheye lens is one.
    model = info.distortion_model
    if model in FISHEYE_MODELS or (distortion.any() and model not in (LENS_MODEL, "")):
        raise CalibrationError(
            f"{where}: distortion model {model[:80]!r} is not supported, expected {LENS_MODEL}"
        )
    if distortion.size not in (0, 4, 5) and distortion.any():
        raise CalibrationError(
            f"{where}: {distortion.size} distortion coefficients, expected k1 k2 p1 p2 (k3)"
        )
    # A region of the whole image is none.
    region = (info.roi.width, info.roi.height)
    whole = region in ((0, 0), (info.width, info.height))
    if info.binning_x > 1 or info.binning_y > 1 or not whole:
        raise CalibrationError(f"{where}: binning or a region of interest, expected full images")
    lens = np.zeros(5)
    if distortion.any():
        lens[: distortion.size] = distortion
    return matrix, lens


class FrameTree:
    """The newest transform from each coordinate frame to its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, FloatArray]] = {}

    def put(
        self, parent: str, child: str, quaternion: Sequence[float], translation_m: Sequence[float]
    ) -> None:
        """Take a transform.

        Args:
            parent: name of the parent frame.
            child: name of the child frame.
            quaternion: (w, x, y, z) of any non-zero length, child to parent.
            translation_m: (x, y, z) of the child's origin in the parent frame.

        Raises:
            CalibrationError: numbers that are no transform; names both frames.
        """
        numbers = np.array([*quaternion, *translation_m], dtype=np.float64)
        if not np.isfinite(numbers).all() or not numbers[:4].any():
            raise CalibrationError(
                f"transform {parent} -> {child}: rotation {_listed(numbers[:4])} (w x y z) and "
                f"translation {_listed(numbers[4:])}, expected finite numbers and a non-zero "
                "quaternion"
            )
        T_parent_child = transform(rotation_from_quaternion(numbers[:4]), numbers[4:])
        self._parents[child] = (parent, T_parent_child)

    def __contains__(self, frame: str) -> bool:
        """Whether the frame has a parent."""
        return frame in self._parents

    def up(self, frame: str, stop: str | None = None) -> tuple[str, FloatArray]:
        """Follow the parents of a frame up to the root, or up to one of them.

        Args:
            frame: where to begin.
            stop: the ancestor to stop at; None or one that is no ancestor: the root.

        Returns:
            The ancestor and `T_ancestor_frame` (4, 4).

        Raises:
            CalibrationError: the frames form a cycle.
        """
        T, seen, ancestor = np.eye(4), {frame}, frame
        while ancestor in self._parents and ancestor != stop:
            ancestor, T_parent_child = self._parents[ancestor]
            if ancestor in seen:
                raise CalibrationError(f"the transforms of {frame} form a cycle")
            seen.add(ancestor)
            T = T_parent_child @ T
        return ancestor, T


def _listed(values: FloatArray) -> str:
    return " ".join(f"{value:g}" for value in values)
