"""The edge map: strength of brightness edges in and near the silhouette."""

import cv2
import numpy as np

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.imaging.images import Image, grey_of
from markerless_tracker.imaging.masks import Mask
from markerless_tracker.imaging.settings import ImagingSettings
from markerless_tracker.observation import locked


def edge_radius_px(settings: ImagingSettings) -> int:
    """Radius of the mask and image region that a pixel's edge strength depends on, px."""
    return settings.edges.margin_px + settings.edges.blur_px // 2 + 1


def edge_map(image: Image, mask: Mask, settings: ImagingSettings) -> Image:
    """Edge strength (h, w) uint8, 255 = 1: gradient, threshold, dilated silhouette, blur.

    The steps are in H-MCPSO's order; the published threshold (squared Sobel / 8 gradient >= 16,
    that is 4 grey levels per pixel) and the 7 x 7 blur are those of PARSEC's bodytrack. Gradient
    and blur depend on the resolution: at half the size the same edge is about twice as steep, and
    the blur covers twice as much of the body.

    Args:
        image: (h, w) or (h, w, 3) uint8.
        mask: (h, w) uint8, 0 or 255; an empty mask gives an empty map.
        settings: the group `edges`.
    """
    height, width = mask.shape
    edges = np.zeros((height, width), dtype=np.uint8)
    left, top, w, h = cv2.boundingRect(mask)
    if w == 0 or h == 0:
        return edges
    margin = settings.edges.margin_px
    border_px = margin + settings.edges.blur_px + 1
    u0, v0 = max(left - border_px, 0), max(top - border_px, 0)
    u1, v1 = min(left + w + border_px, width), min(top + h + border_px, height)
    # All parts are contiguous and read-only, so that the kernel is compiled once.
    grey = locked(grey_of(image[v0:v1, u0:u1]), np.uint8)
    strength = _gradient_strength(grey, settings)
    near = mask[v0:v1, u0:u1]
    if margin > 0:
        brush = np.ones((2 * margin + 1, 2 * margin + 1), dtype=np.uint8)
        near = np.asarray(cv2.dilate(near, brush), dtype=np.uint8)
    cv2.bitwise_and(strength, near, dst=strength)
    side = settings.edges.blur_px
    if side > 1:
        border = cv2.BORDER_REPLICATE
        cv2.GaussianBlur(strength, (side, side), 0.0, dst=strength, borderType=border)
    edges[v0:v1, u0:u1] = strength
    return edges


def _gradient_strength(grey: Image, settings: ImagingSettings) -> Image:
    """Sobel gradient of a grey image (h, w), thresholded by `edges.form`, 0..255."""
    strength = np.empty_like(grey)
    threshold = 8.0 * settings.edges.gradient
    if settings.edges.form == "published":
        # A step at the threshold: no values between 0 and 255.
        low = np.float32(threshold * (1.0 - 1e-6))
        gradient_strength(grey, low, np.float32(np.inf), strength)
    else:
        gain = np.float32(255.0 / (1.5 * threshold))
        gradient_strength(grey, np.float32(0.5 * threshold), gain, strength)
    return strength


@kernel
def _weighted(above, here, below, smooth, slope):  # type: ignore[no-untyped-def]
    """Three rows (w,) into smooth, slope (w + 2,), the last values repeated at both ends."""
    n = here.size
    for j in range(n):
        smooth[1 + j] = np.int32(above[j]) + 2 * np.int32(here[j]) + np.int32(below[j])
    for j in range(n):
        slope[1 + j] = np.int32(below[j]) - np.int32(above[j])
    smooth[0] = smooth[1]
    smooth[n + 1] = smooth[n]
    slope[0] = slope[1]
    slope[n + 1] = slope[n]


@kernel
def _steep(smooth, slope, low, gain, out):  # type: ignore[no-untyped-def]
    full = np.float32(255.0)
    for j in range(out.size):
        across = smooth[j + 2] - smooth[j]
        down = slope[j] + 2 * slope[j + 1] + slope[j + 2]
        # Whole numbers below 2^24 are exact in float32: the same on any machine.
        size = np.sqrt(np.float32(across * across + down * down))
        value = (size - low) * gain
        value = value if size > low else np.float32(0.0)
        out[j] = np.uint8(np.int32(min(value, full) + np.float32(0.5)))


@compiled()
def gradient_strength(grey, low, gain, strength):  # type: ignore[no-untyped-def]
    """Fill strength (h, w) uint8 with (Sobel gradient - low) gain of grey (h, w) uint8, to 255."""
    rows, columns = grey.shape
    smooth = np.empty(columns + 2, dtype=np.int32)
    slope = np.empty(columns + 2, dtype=np.int32)
    for i in range(rows):
        _weighted(grey[max(i - 1, 0)], grey[i], grey[min(i + 1, rows - 1)], smooth, slope)
        _steep(smooth, slope, low, gain, strength[i])
