"""Alignment of a picture to another of the same scene: geometry, then exposure."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.imaging.images import FloatImage, Image, grey_of

# Number of tiles along the longer side of the image; the shift of each tile is measured.
_TILES = 6
# Phase correlations with a lower peak are not used.
_LEAST_RESPONSE = 0.15


def align_geometry(image: Image, reference: Image) -> Image:
    """``image`` resized to the reference and moved onto it by an affine map.

    Phase correlation of edges measures the shift of each tile; RANSAC fits one affine map to the
    shifts. Tiles with a person in either image are outliers. The image is only resized if too few
    tiles agree or if the map moves no corner by a quarter of a pixel.

    Args:
        image: (h', w') or (h', w', 3) uint8.
        reference: (h, w) or (h, w, 3) uint8.
    """
    height, width = reference.shape[:2]
    resized = image
    if image.shape[:2] != (height, width):
        resized = np.asarray(
            cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8
        )
    here, there = _tile_shifts(grey_of(resized), grey_of(reference))
    if len(here) < 6:
        return resized
    # OpenCV seeds RANSAC itself: the same images give the same map.
    affine, inliers = cv2.estimateAffine2D(
        there, here, method=cv2.RANSAC, ransacReprojThreshold=0.5
    )
    if affine is None or int(inliers.sum()) < max(6, len(here) // 3):
        return resized
    corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1]], dtype=float)
    if np.abs(corners @ affine.T - corners[:, :2]).max() < 0.25:
        return resized
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(
            resized, affine, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
        ),
        dtype=np.uint8,
    )


def _tile_shifts(image: Image, reference: Image) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Centres of tiles in the image and in the reference, (n, 2) px each."""
    height, width = reference.shape
    if min(height, width) < 2:
        return np.empty((0, 2), np.float32), np.empty((0, 2), np.float32)
    tile = max(32, 2 * max(height, width) // (_TILES + 1))
    first = cv2.Laplacian(image, cv2.CV_32F, ksize=3)
    second = cv2.Laplacian(reference, cv2.CV_32F, ksize=3)
    here, there = [], []
    for top in _starts(height, tile):
        for left in _starts(width, tile):
            a = np.ascontiguousarray(second[top : top + tile, left : left + tile])
            b = np.ascontiguousarray(first[top : top + tile, left : left + tile])
            window = cv2.createHanningWindow((a.shape[1], a.shape[0]), cv2.CV_32F)
            (du, dv), response = cv2.phaseCorrelate(a, b, window)
            if response >= _LEAST_RESPONSE and np.hypot(du, dv) < 0.25 * tile:
                centre = (left + 0.5 * a.shape[1], top + 0.5 * a.shape[0])
                there.append(centre)
                here.append((centre[0] + du, centre[1] + dv))
    return np.array(here, dtype=np.float32), np.array(there, dtype=np.float32)


def _starts(length: int, tile: int) -> list[int]:
    """First pixel of each of the tiles that cover a length and overlap by about half."""
    if length <= tile:
        return [0]
    count = -(-2 * (length - tile) // tile) + 1
    return [round(i * (length - tile) / (count - 1)) for i in range(count)]


def align_exposure(image: FloatImage, reference: FloatImage) -> FloatImage:
    """``image`` with gain and offset per channel fitted to the reference, then a smooth offset.

    Pixels that differ after the fit (people, moved objects) are outliers. The smooth offset
    corrects local differences, such as light from a window.

    Args:
        image: (h, w, c) float32, in the reference's geometry.
        reference: (h, w, c) float32.
    """
    fitted = np.empty_like(image)
    for channel in range(image.shape[2]):
        gain, offset = _robust_line(image[:, :, channel], reference[:, :, channel])
        fitted[:, :, channel] = gain * image[:, :, channel] + offset
    rest = reference - fitted
    spread = np.abs(rest).max(axis=2)
    agree = (spread < max(8.0, 2.5 * float(np.median(spread)))).astype(np.float32)
    size = max(3.0, 0.04 * max(image.shape[:2]))
    aligned: FloatImage = np.clip(fitted + _smooth(rest, agree, size), 0.0, 255.0)
    return aligned


def _robust_line(x: FloatImage, y: FloatImage) -> tuple[float, float]:
    """Gain and offset of y = gain x + offset, for two images (h, w); gain 1 if undetermined."""
    step = max(1, x.size // 40000)
    a, b = x.ravel()[::step].astype(np.float64), y.ravel()[::step].astype(np.float64)
    # Clipped pixels carry no information about the gain.
    open_range = (a > 3) & (a < 250) & (b > 3) & (b < 250)
    keep = open_range.copy()
    gain, offset = 1.0, float(np.median(b - a))
    for _ in range(15):
        if keep.sum() < 50 or np.ptp(a[keep]) < 10:
            break
        gain, offset = np.polyfit(a[keep], b[keep], 1)
        residual = np.abs(gain * a + offset - b)
        keep = open_range & (residual <= max(3.0, 2.0 * float(np.median(residual[open_range]))))
    return (float(gain), float(offset)) if 0.5 < gain < 2.0 else (1.0, float(np.median(b - a)))


def _smooth(rest: FloatImage, weight: FloatImage, sigma_px: float) -> FloatImage:
    """Normalised blur of ``rest`` where ``weight`` is 1, computed at a quarter of the size."""
    height, width = weight.shape
    size = (max(1, width // 4), max(1, height // 4))
    small = cv2.resize(rest * weight[:, :, None], size, interpolation=cv2.INTER_AREA)
    mass = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
    small = small.reshape(size[1], size[0], -1)
    blurred = cv2.GaussianBlur(small, (0, 0), sigma_px / 4.0).reshape(small.shape)
    mass = cv2.GaussianBlur(mass, (0, 0), sigma_px / 4.0)
    field = blurred / (mass[:, :, None] + np.float32(0.02))
    full = cv2.resize(field, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(full, dtype=np.float32).reshape(rest.shape)
