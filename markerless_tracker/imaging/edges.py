"""The edge map: where the silhouette's neighbourhood changes brightness, in [0, 1]."""

import cv2
import numpy as np

from markerless_tracker.imaging.images import Image, grey_of
from markerless_tracker.imaging.morphology import Mask
from markerless_tracker.imaging.settings import ImagingSettings


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
    grey = grey_of(image[v0:v1, u0:u1])
    across = cv2.Sobel(grey, cv2.CV_16S, 1, 0, borderType=cv2.BORDER_REPLICATE)
    down = cv2.Sobel(grey, cv2.CV_16S, 0, 1, borderType=cv2.BORDER_REPLICATE)
    square = cv2.magnitude(across.astype(np.float32), down.astype(np.float32))
    threshold = 8.0 * settings.edge_gradient
    if settings.edge_form == "published":
        strength = (square >= threshold).astype(np.uint8) * np.uint8(255)
    else:
        gain = 255.0 / (1.5 * threshold)
        strength = cv2.convertScaleAbs(np.maximum(square - 0.5 * threshold, 0.0), alpha=gain)
    near = mask[v0:v1, u0:u1]
    if margin > 0:
        near = cv2.dilate(near, np.ones((2 * margin + 1, 2 * margin + 1), dtype=np.uint8))
    strength = cv2.bitwise_and(strength, near)
    side = settings.edge_blur_px
    if side > 1:
        strength = cv2.GaussianBlur(strength, (side, side), 0.0, borderType=cv2.BORDER_REPLICATE)
    edges[v0:v1, u0:u1] = strength
    return edges
