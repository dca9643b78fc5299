"""Body drawn over an image: outlines coloured by side, markers as dots."""

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import MARKER_NAMES, BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.drawing.outline import fixed_point, outlines
from markerless_tracker.errors import ImageError
from markerless_tracker.geometry import FloatArray

Image = NDArray[np.uint8]

LEFT_BGR, RIGHT_BGR, CENTRE_BGR = (255, 255, 0), (0, 255, 255), (255, 255, 255)
"""Colours of the left side (cyan) and the right side (yellow), as in Fleischmann et al. (2012), and
of the rest (white), BGR."""
ELLIPSE_SD = 2.0
"""Radius of the ellipses of uncertainty in standard deviations."""
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
    markers_sd_m: FloatArray | None = None,
    surfaces: FloatArray | None = None,
) -> Image:
    """A copy (h, w, 3) BGR of an image with the body at a pose (p,) drawn over it.

    Cones are outlined, the 15 markers are dots, a given mask (h, w) is tinted. Standard deviations
    (15, 3) of the markers along x, y, z in m (NaN = unknown), if given, are drawn as ellipses of
    `ELLIPSE_SD`. `surfaces` are the body's `cone_surfaces`, None = computed here. Parts behind the
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
    polygons = outlines(body, pose, camera, surfaces=surfaces)
    for name, polygon in zip(body.cone_names, polygons, strict=True):
        if len(polygon) >= 3:
            points, shift = fixed_point(polygon)
            cv2.polylines(
                picture, [points[:, None]], True, side_colour(name), thickness, cv2.LINE_AA, shift
            )
    positions = markers(body, pose)
    if markers_sd_m is not None:
        for name, box in _ellipses(positions, markers_sd_m, camera):
            cv2.ellipse(picture, box, side_colour(name), 1, cv2.LINE_AA)
    for name, pixel in zip(MARKER_NAMES, project_camera(positions, camera), strict=True):
        if np.isfinite(pixel).all():
            (centre,), shift = fixed_point(pixel[None])
            at, one = (int(centre[0]), int(centre[1])), 1 << shift
            cv2.circle(picture, at, 2 * thickness * one, side_colour(name), -1, cv2.LINE_AA, shift)
            cv2.circle(picture, at, 2 * thickness * one, (255, 255, 255), 1, cv2.LINE_AA, shift)
    return picture


def _ellipses(
    positions_m: FloatArray, sd_m: FloatArray, camera: CameraModel
) -> Iterator[tuple[str, tuple[tuple[float, float], tuple[float, float], float]]]:
    """Marker and (centre in px, diameters in px, angle in degrees) of each ellipse."""
    ends = positions_m[:, None] + sd_m[:, :, None] * np.eye(3)
    centres = project_camera(positions_m, camera)
    moved = project_camera(ends.reshape(-1, 3), camera).reshape(-1, 3, 2) - centres[:, None]
    # NaN (behind the camera, or unknown deviation) is not below any limit.
    limit = 4.0 * max(camera.size_px)
    known = np.asarray((np.abs(centres) < limit).all(1) & (np.abs(moved) < limit).all((1, 2)))
    variances, directions = np.linalg.eigh(moved[known].transpose(0, 2, 1) @ moved[known])
    diameters = 2.0 * ELLIPSE_SD * np.sqrt(np.maximum(variances[:, ::-1], 0.0))
    angles = np.degrees(np.arctan2(directions[:, 1, 1], directions[:, 0, 1]))
    names = (name for name, here in zip(MARKER_NAMES, known, strict=True) if here)
    rows = zip(centres[known].tolist(), diameters.tolist(), angles.tolist(), strict=True)
    for name, (centre, (long, short), angle) in zip(names, rows, strict=True):
        yield name, ((centre[0], centre[1]), (long, short), angle)
