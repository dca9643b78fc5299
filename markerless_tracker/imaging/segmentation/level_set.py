"""Localised active contour: moves the silhouette's contour to the local change of colour."""

import cv2
import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import Image
from markerless_tracker.imaging.masks import Mask

# Window of the smoothing force, px.
_SMOOTH_PX = 5
# Least sum of both forces for which a pixel changes sides.
_LEAST_FORCE = np.float32(0.2)


@kernel
def move_contour(image, total, inside, size, count, smooth, mask, band, least, out):  # type: ignore[no-untyped-def]
    """One step of the contour: pixels beside it that fit the other side better are moved to it.

    Args:
        image: (a, b, c) uint8.
        total, inside: (a, b, c) int32, sums over windows of the image, and of the image in the
            mask.
        size, count: (a, b) int32, pixels of the window, and those in the mask.
        smooth: (a, b) int32, pixels in the mask of a small window.
        mask: (a, b) uint8, 0 or 1.
        band: (a, b) uint8, 0 where no pixel may change.
        least: least squared difference of both sides' means for which the contour moves.
        out: (a, b) uint8, the new mask; written.
    """
    rows, columns = mask.shape
    channels = image.shape[2]
    area = np.float32(_SMOOTH_PX * _SMOOTH_PX)
    for i in range(rows):
        for j in range(columns):
            side = mask[i, j]
            out[i, j] = side
            if band[i, j] == 0 or count[i, j] == 0 or count[i, j] == size[i, j]:
                continue
            border = False
            for y, x in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                if 0 <= y < rows and 0 <= x < columns and mask[y, x] != side:
                    border = True
            if not border:
                continue
            n_in = np.float32(count[i, j])
            n_out = np.float32(size[i, j]) - n_in
            along = np.float32(0.0)
            contrast = np.float32(0.0)
            for c in range(channels):
                u = np.float32(inside[i, j, c]) / n_in
                v = np.float32(total[i, j, c] - inside[i, j, c]) / n_out
                along += (u - v) * (np.float32(2.0) * np.float32(image[i, j, c]) - u - v)
                contrast += (u - v) * (u - v)
            if contrast < least:
                continue
            force = min(max(along / contrast, np.float32(-1.0)), np.float32(1.0))
            force += np.float32(2.0) * np.float32(smooth[i, j]) / area - np.float32(1.0)
            if side != 0 and force < -_LEAST_FORCE:
                out[i, j] = 0
            elif side == 0 and force > _LEAST_FORCE:
                out[i, j] = 1


def refinement_radius_px(iterations: int, radius_px: int) -> int:
    """Radius of the neighbourhood that a pixel's result of `refine_contour` depends on, px."""
    return iterations * (radius_px + 1)


def refine_contour(
    image: Image, mask: Mask, *, iterations: int, radius_px: int, least: float
) -> None:
    """Move a mask's contour to the local contrast beside it, in place.

    Localised region-based active contour with the uniform modelling energy: Lankton & Tannenbaum
    (2008), "Localizing region-based active contours", Eq 12 and 13. At each point of the contour
    the local image has the means u inside and v outside. The point moves to the side whose mean is
    nearer to its colour; a second force keeps the contour smooth. Differences from the paper:

    - the contour runs between pixels in steps of a pixel: only the sign of the level set function
      is kept, without gradient and reinitialisation;
    - the force is (u - v)(2 I - u - v) of the point's own colour I, over all channels, relative to
      the contrast (u - v)^2; the paper sums it along the contour in the ball;
    - smoothness is the fraction of a 5x5 window that the mask fills, not the curvature;
    - the ball is a square, since sums over squares cost the same for every radius;
    - the contour does not move where the contrast is below `least`, and moves by at most one pixel
      per iteration from its origin: the foreground test has more information than local colours.

    Args:
        image: (h, w, c) uint8.
        mask: (h, w) uint8, 0 or 255.
        iterations: number of steps, of one pixel each.
        radius_px: half the side of the square.
        least: least difference of both sides' means, grey levels.
    """
    side = 2 * radius_px + 1
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    state = (mask > 0).astype(np.uint8)
    grown = cv2.dilate(state, cross, iterations=iterations)
    core = cv2.erode(state, cross, iterations=iterations)
    band = np.asarray(cv2.subtract(grown, core), dtype=np.uint8)
    total = _sums(image, side)
    size = _sums(np.ones_like(state), side)
    moved = np.empty_like(state)
    for _ in range(iterations):
        inside = _sums(image * state[:, :, None], side)
        count, smooth = _sums(state, side), _sums(state, _SMOOTH_PX)
        move_contour(
            image, total, inside, size, count, smooth, state, band, np.float32(least**2), moved
        )
        state, moved = moved, state
    np.multiply(state, np.uint8(255), out=mask)


def _sums(values: Mask, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    """Exact sums (h, w) or (h, w, c) over squares; zero beyond the image."""
    sums = cv2.boxFilter(
        values, cv2.CV_32S, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    # OpenCV drops a single channel.
    return np.asarray(sums, dtype=np.int32).reshape(values.shape)
