"""Comparison of a scene with its background image: differing pixels, shift of the camera."""

import cv2
import numpy as np

from markerless_tracker.geometry import FloatArray

DIFFERENCE = 28.0
"""A pixel differs if its grey level does by more than this."""
_LEAST_RESPONSE = 0.08


def unlike_share(scene: FloatArray, background: FloatArray) -> float:
    """Share of differing pixels (h, w) among those neither dark nor overexposed."""
    usable = (background > 10.0) & (background < 245.0)
    if not usable.any():
        return 1.0
    return float((np.abs(scene - background)[usable] > DIFFERENCE).mean())


def moved_px(scene: FloatArray, background: FloatArray) -> float:
    """Length of the shift between two pictures (h, w) of a scene, by phase correlation of edges.

    0 if the pictures have too little in common.
    """
    # phaseCorrelate pads to the next optimal DFT size, which biases the shift by half a pixel.
    height, width = (_fast_size(length) for length in scene.shape)
    edges = [
        cv2.Laplacian(
            cv2.GaussianBlur(image[:height, :width].astype(np.float32), (0, 0), 1.5), cv2.CV_32F
        )
        for image in (background, scene)
    ]
    # Otherwise a few strong edges, such as those of a person, would dominate.
    limits = [max(3.0 * float(np.median(np.abs(e))), 1e-3) for e in edges]
    first, second = (np.clip(e, -m, m) for e, m in zip(edges, limits, strict=True))
    window = cv2.createHanningWindow((first.shape[1], first.shape[0]), cv2.CV_32F)
    (du, dv), response = cv2.phaseCorrelate(first, second, window)
    return float(np.hypot(du, dv)) if response >= _LEAST_RESPONSE else 0.0


def _fast_size(length: int) -> int:
    """The largest even length up to the given one whose DFT needs no padding."""
    return max(n for n in range(2, length + 1, 2) if cv2.getOptimalDFTSize(n) == n)
