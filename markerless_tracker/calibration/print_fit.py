"""Refines a board's corners: compares the image with the print around each of them.

A saddle point search alone is biased by whatever else is in its window, such as the markers of a
ChArUco board (1 px at squares of 12 px). Here the whole print around a corner is compared.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift

from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image

TEXELS = 24
"""Size of a square of a print, in its own pixels."""
BORDER_PX = 4
"""Corners this near to an image's border are left out."""
_FEWEST = 4
_PASSES = 4
_PATCH = 0.8
"""Half the part of a print that is compared, in squares: within the outer squares of the board."""
_PATCH_PX = (4, 24)
_MOST_MOVED = 0.3
"""Largest distance of a corner from its expected position, in squares."""
_SAMPLES = 3
_BLUR_PX = 0.7
_AGREE = 0.7
"""Least correlation of image and print around a corner."""


class Print:
    """A print, and the search for its corners in images.

    Args:
        picture: (rows * TEXELS, columns * TEXELS) grey levels of all squares, without a border.
        corners: (n, 2) of the corners, in squares from its top left, y down.
    """

    def __init__(self, picture: Image, corners: FloatArray) -> None:
        self.picture, self.corners = picture, corners

    def measured(
        self, grey: Image, plane: FloatArray, pixels: FloatArray
    ) -> tuple[NDArray[np.int64], FloatArray] | None:
        """Corners by least squares between the image and the print around each of them.

        Args:
            grey: (h, w) the image.
            plane: (3, 3) homography from the print, in squares, to pixels; lenses may bend it.
            pixels: (n, 2) where the corners are expected, NaN for those that only the homography
                determines.

        Returns:
            Numbers (m,) and pixels (m, 2) of the corners that look like those of the print; None
            if too few do.
        """
        found = pixels
        for _ in range(_PASSES):
            expected, spacing = mapped(plane, self.corners), self.spacing(plane)
            found = np.where(np.isfinite(found), found, expected)
            picture, low = self._picture(plane, grey)
            again = np.full_like(found, np.nan)
            for number in np.flatnonzero(inside(expected, grey) & inside(found, grey)):
                again[number] = found[number] + _correction(
                    grey, picture, low, expected[number], found[number], float(spacing[number])
                )
            known = np.isfinite(again).all(axis=1)
            new = plane_of(self.corners[known], again[known]) if known.sum() >= _FEWEST else None
            if new is None:
                return None
            plane, found = new, again
        return np.flatnonzero(known), found[known]

    def spacing(self, plane: FloatArray) -> FloatArray:
        """(n,) side of a square at each corner, the shorter one, px."""
        sides = [
            np.linalg.norm(
                mapped(plane, self.corners + step) - mapped(plane, self.corners - step), axis=1
            )
            for step in (np.array([0.5, 0.0]), np.array([0.0, 0.5]))
        ]
        return np.asarray(np.minimum(*sides))

    def _picture(self, plane: FloatArray, grey: Image) -> tuple[FloatArray, NDArray[np.int_]]:
        """The print as a homography shows it, with the lens's blur, and where it begins (u, v)."""
        size = np.array(self.picture.shape[::-1])
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (size / TEXELS)
        outline = mapped(plane, corners)
        limits = np.array(grey.shape[::-1])
        low = np.clip(np.floor(outline.min(axis=0)).astype(int) - BORDER_PX, 0, limits - 1)
        high = np.clip(np.ceil(outline.max(axis=0)).astype(int) + BORDER_PX, low + 1, limits)
        to_texels = np.array([[1 / TEXELS, 0, 0.5 / TEXELS], [0, 1 / TEXELS, 0.5 / TEXELS]])
        to_samples = np.array(
            [
                [_SAMPLES, 0.0, 0.5 * _SAMPLES - 0.5 - _SAMPLES * low[0]],
                [0.0, _SAMPLES, 0.5 * _SAMPLES - 0.5 - _SAMPLES * low[1]],
                [0.0, 0.0, 1.0],
            ]
        )
        width, height = (int(value) for value in (high - low))
        warped = cv2.warpPerspective(
            self.picture,
            to_samples @ plane @ np.vstack([to_texels, [0.0, 0.0, 1.0]]),
            (_SAMPLES * width, _SAMPLES * height),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=255,
        )
        small = cv2.resize(warped, (width, height), interpolation=cv2.INTER_AREA)
        picture = cv2.GaussianBlur(small.astype(np.float32), (0, 0), _BLUR_PX)
        return np.asarray(picture, dtype=np.float64), low


def plane_of(points: FloatArray, pixels: FloatArray, most_px: float = 3.0) -> FloatArray | None:
    """Homography (3, 3) from points (n, 2) to pixels (n, 2) but for outliers; None without one."""
    found, _ = cv2.findHomography(
        points.astype(np.float32), pixels.astype(np.float32), cv2.RANSAC, most_px
    )
    return None if found is None else np.asarray(found, dtype=np.float64)


def mapped(plane: FloatArray, points: FloatArray) -> FloatArray:
    """Pixels (n, 2) of points (n, 2)."""
    mapped = cv2.perspectiveTransform(points.reshape(-1, 1, 2), plane)
    return np.asarray(mapped, dtype=np.float64).reshape(-1, 2)


def inside(pixels: FloatArray, image: Image) -> NDArray[np.bool_]:
    """(n,) which pixels are in an image and not at its border."""
    size = np.array(image.shape[1::-1])
    within = (pixels > BORDER_PX) & (pixels < size - 1 - BORDER_PX)
    return np.asarray(within.all(axis=1))


def correlation(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Correlation of two arrays of one shape."""
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum() + 1e-12))


def _correction(
    grey: Image,
    picture: FloatArray,
    low: NDArray[np.int_],
    expected: FloatArray,
    found: FloatArray,
    spacing: float,
) -> FloatArray:
    """Step (2,) px from where a corner was found to where the print around it lies in the image.

    Args:
        grey: (h, w) the image.
        picture, low: of `Print._picture`.
        expected: (2,) px by the homography.
        found: (2,) px, so far.
        spacing: side of a square, px.

    Returns:
        The step; NaN if the corner is too far away, or does not look like that of the print.
    """
    unknown = np.full(2, np.nan)
    beside = found - expected
    off = np.rint(beside).astype(int)
    half = int(np.clip(_PATCH * spacing, *_PATCH_PX))
    middle = np.rint(expected).astype(int)
    # Inside the picture, and moved by `off` inside the image.
    first = np.maximum(np.maximum(middle - half, low), -off)
    last = np.minimum(middle + half + 1, low + picture.shape[::-1])
    last = np.minimum(last, np.array(grey.shape[::-1]) - off)
    here, there = _part(first + off, last + off), _part(first - low, last - low)
    if min(picture[there].shape) < 3 or grey[here].shape != picture[there].shape:
        return unknown
    # A lens bends the print: the picture there is that of the homography, moved.
    moved = _shift(grey[here], shift(picture[there], (beside - off)[::-1], mode="nearest"))
    if moved is None or np.linalg.norm(moved) > _MOST_MOVED * spacing:
        return unknown
    return moved


def _part(first: NDArray[np.int_], last: NDArray[np.int_]) -> tuple[slice, slice]:
    """Rows and columns from (u, v) to (u, v), exclusive."""
    return slice(first[1], max(last[1], first[1])), slice(first[0], max(last[0], first[0]))


def _shift(image: Image, picture: FloatArray) -> FloatArray | None:
    """(2,) px by which a part of an image lies beside a picture; None if they do not agree.

    Least squares of image = gain * (picture - slopes * shift) + offset.
    """
    if correlation(image.astype(np.float64), picture) < _AGREE:
        return None
    along_v, along_u = np.gradient(picture)
    columns = [picture.ravel(), np.ones(image.size), -along_u.ravel(), -along_v.ravel()]
    solved, _, rank, _ = np.linalg.lstsq(np.column_stack(columns), image.ravel(), rcond=None)
    if rank < 4 or solved[0] <= 0.0:
        return None
    return np.asarray(solved[2:] / solved[0], dtype=np.float64)
