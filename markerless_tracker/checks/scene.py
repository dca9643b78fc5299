"""Whether a scene is that of a background image: differing pixels, shift of the camera."""

import cv2
import numpy as np

from markerless_tracker.geometry import FloatArray

DIFFERENCE = 28.0
"""Grey levels by which a pixel differs."""
_LEAST_RESPONSE = 0.08


def unlike_share(scene: FloatArray, background: FloatArray) -> float:
    """Share of pixels (h, w) that differ, of those that are neither dark nor overexposed."""
    usable = (background > 10.0) & (background < 245.0)
    if not usable.any():
        return 1.0
    return float((np.abs(scene - background)[usable] > DIFFERENCE).mean())


def moved_px(scene: FloatArray, background: FloatArray) -> float:
    """Length of the shift between two pictures (h, w) of a scene, by phase correlation of edges.

    0 where the pictures have too little in common.
    """
    # phaseCorrelate fills up to the next fast size, by which the shift is half a pixel off.
    height, width = (_fast_size(length) for length in scene.shape)
    edges = [
        cv2.Laplacian(
            cv2.GaussianBlur(image[:height, :width].astype(np.float32), (0, 0), 1.5), cv2.CV_32F
        )
        for image in (background, scene)
    ]
    # A few strong edges, such as those of a person, would decide alone.
    limits = [max(3.0 * float(np.median(np.abs(e))), 1e-3) for e in edges]
    first, second = (np.clip(e, -m, m) for e, m in zip(edges, limits, strict=True))
    window = cv2.createHanningWindow((first.shape[1], first.shape[0]), cv2.CV_32F)
    (du, dv), response = cv2.phaseCorrelate(first, second, window)
    return float(np.hypot(du, dv)) if response >= _LEAST_RESPONSE else 0.0


def _fast_size(length: int) -> int:
    """The largest even length, at most as long, for which a Fourier transform needs no filling."""
    return max(n for n in range(2, length + 1, 2) if cv2.getOptimalDFTSize(n) == n)
