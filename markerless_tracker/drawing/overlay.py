"""Body drawn over an image: outlines coloured by side, markers as dots."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.drawing.outline import fixed_point, outlines
from markerless_tracker.errors import ImageError
from markerless_tracker.geometry import FloatArray

Image = NDArray[np.uint8]

LEFT_BGR, RIGHT_BGR, CENTRE_BGR = (60, 200, 60), (50, 80, 255), (255, 190, 40)
"""Colours of the left side (green), the right side (red) and the rest (blue), BGR."""
_MASK_BGR = (255, 0, 255)
_PLANES: tuple[tuple[int, ...], ...] = ((), (1,), (3,))


def side_colour(name: str) -> tuple[int, int, int]:
    """Colour of a cone (`l_thigh`) or marker (`LKnee`), by the side in its name."""
    if name.startswith("l_") or (name in MARKER_NAMES and name.startswith("L")):
        return LEFT_BGR
    if name.startswith("r_") or (name in MARKER_NAMES and name.startswith("R")):
        return RIGHT_BGR
    return CENTRE_BGR


def as_colour(image: Image, camera: CameraModel) -> Image:
    """A copy (h, w, 3) of a BGR or grey image.

    Raises:
        ImageError: its size differs from the camera's, or it is no 8-bit grey or BGR image.
    """
    width, height = camera.size_px
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in _PLANES:
        raise ImageError(
            f"{camera.name}: image of shape {image.shape} and type {image.dtype}, "
            "expected 8-bit grey or BGR"
        )
    if image.shape[:2] != (height, width):
        raise ImageError(
            f"{camera.name}: image of {image.shape[1]}x{image.shape[0]} px, "
            f"expected {width}x{height}"
        )
    plane = image.reshape(height, width, -1)
    return np.ascontiguousarray(np.broadcast_to(plane, (height, width, 3))).copy()


def draw_overlay(
    image: Image,
    camera: CameraModel,
    body: BodyModel,
    pose: FloatArray,
    *,
    mask: NDArray[np.bool_] | None = None,
) -> Image:
    """A copy (h, w, 3) BGR of an image with the body at a pose (p,) drawn over it.

    Cones are outlined, the 15 markers are dots, a given mask (h, w) is tinted. Parts behind the
    camera are left out.

    Raises:
        ImageError: the image or mask does not fit the camera.
    """
    picture = as_colour(image, camera)
    if mask is not None:
        if mask.shape != picture.shape[:2]:
            raise ImageError(
                f"{camera.name}: mask of shape {mask.shape}, expected {picture.shape[:2]}"
            )
        tint = 0.75 * picture[mask != 0] + 0.25 * np.array(_MASK_BGR)
        picture[mask != 0] = np.rint(tint).astype(np.uint8)
    thickness = 1 if max(camera.size_px) < 1000 else 2
    for name, polygon in zip(body.cone_names, outlines(body, pose, camera), strict=True):
        if len(polygon) >= 3:
            points, shift = fixed_point(polygon)
            cv2.polylines(
                picture, [points[:, None]], True, side_colour(name), thickness, cv2.LINE_AA, shift
            )
    for name, pixel in zip(MARKER_NAMES, project_camera(markers(body, pose), camera), strict=True):
        if np.isfinite(pixel).all():
            (centre,), shift = fixed_point(pixel[None])
            at, one = (int(centre[0]), int(centre[1])), 1 << shift
            cv2.circle(picture, at, 2 * thickness * one, side_colour(name), -1, cv2.LINE_AA, shift)
            cv2.circle(picture, at, 2 * thickness * one, (255, 255, 255), 1, cv2.LINE_AA, shift)
    return picture
