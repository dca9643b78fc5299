"""The edge map: where the silhouette's neighbourhood changes brightness, in [0, 1]."""

import cv2
import numpy as np

from markerless_tracker.imaging.images import Image, grey_of
from markerless_tracker.imaging.morphology import Mask
from markerless_tracker.imaging.settings import ImagingSettings


def edge_reach(settings: ImagingSettings) -> int:
    """How far from a pixel its edge strength looks at the mask and the image, px."""
    return settings.edge_margin_px + settings.edge_blur_px // 2 + 1


def edge_map(image: Image, mask: Mask, settings: ImagingSettings) -> Image:
    """Edge strength (h, w) uint8, 255 = 1: gradient -> threshold -> dilated silhouette -> blur.

    H-MCPSO's order of steps; the published threshold (squared Sobel / 8 gradient >= 16, that is 4
    grey levels per pixel) and the 7 x 7 blur are those of PARSEC's bodytrack.
    A gradient per pixel and a blur in pixels depend on the resolution: at half the size the same
    edge is about twice as steep and the blur reaches twice as far over the body.

    Args:
        image: (h, w) or (h, w, 3) uint8.
        mask: (h, w) uint8, 0 or 255; all 0 gives an empty map.
        settings: those beginning with ``edge_``.
    """
    height, width = mask.shape
    edges = np.zeros((height, width), dtype=np.uint8)
    left, top, w, h = cv2.boundingRect(mask)
    if w == 0 or h == 0:
        return edges
    margin = settings.edge_margin_px
    reach = margin + settings.edge_blur_px + 1
    u0, v0 = max(left - reach, 0), max(top - reach, 0)
    u1, v1 = min(left + w + reach, width), min(top + h + reach, height)
    strength = _gradient_strength(grey_of(image[v0:v1, u0:u1]), settings)
    near = mask[v0:v1, u0:u1]
    if margin > 0:
        brush = np.ones((2 * margin + 1, 2 * margin + 1), dtype=np.uint8)
        near = np.asarray(cv2.dilate(near, brush), dtype=np.uint8)
    cv2.bitwise_and(strength, near, dst=strength)
    side = settings.edge_blur_px
    if side > 1:
        border = cv2.BORDER_REPLICATE
        cv2.GaussianBlur(strength, (side, side), 0.0, dst=strength, borderType=border)
    edges[v0:v1, u0:u1] = strength
    return edges


def _gradient_strength(grey: Image, settings: ImagingSettings) -> Image:
    """Sobel gradient of a grey image (h, w), thresholded as `edge_form` says, 0..255."""
    border = cv2.BORDER_REPLICATE
    across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, borderType=border)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, borderType=border)
    # Squares and their sum are whole numbers below 2^24, hence exact. cv2.magnitude is not: its
    # last bit depends on where the arrays lie in memory, and results would differ between runs.
    size = np.sqrt(across * across + down * down)
    threshold = 8.0 * settings.edge_gradient
    if settings.edge_form == "published":
        return (size >= threshold).astype(np.uint8) * np.uint8(255)
    gain = 255.0 / (1.5 * threshold)
    # Saturates at 255; what lies below half the threshold is cut off by the subtraction.
    strength = np.maximum(size - np.float32(0.5 * threshold), 0.0)
    return np.asarray(cv2.convertScaleAbs(strength, alpha=gain), dtype=np.uint8)
