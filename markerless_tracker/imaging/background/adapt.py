"""Adaptation of a background to slow changes of light away from the silhouette."""

import math

import cv2
import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.masks import Mask, disc

# Nothing is learned from the first image after a longer gap or a step back in time.
GAP_NS = 1_000_000_000
# Each frame adapts every STRIDE-th row, and the next frame the rows after these.
STRIDE = 4


@kernel
def adapt_means(image, gain, keep_out, mean, scale, share, first, stride):  # type: ignore[no-untyped-def]
    """Move the mean of a pixel's Gaussian towards the pixel: mean += share (image / gain - mean).

    Only rows first, first + stride, ..., and only pixels where `keep_out` (h, w) is 0 and the
    background test passes. image (h, w, c); mean, scale (k, h, w, c); gain (c,).
    """
    modes, height, width, channels = mean.shape
    for v in range(first, height, stride):
        for u in range(width):
            if keep_out[v, u] != 0:
                continue
            for k in range(modes):
                distance = np.float32(0.0)
                for c in range(channels):
                    x = np.float32(image[v, u, c]) - gain[c] * mean[k, v, u, c]
                    x *= scale[k, v, u, c]
                    distance += x * x
                if distance <= np.float32(1.0):
                    for c in range(channels):
                        value = np.float32(image[v, u, c])
                        if value < np.float32(255.0):
                            mean[k, v, u, c] += share * (value / gain[c] - mean[k, v, u, c])
                    break


class Adaptation:
    """Adapts the background of one camera.

    Args:
        time_constant_s: time after which the background has followed a change by 63 %.
        margin_px: distance from the silhouette within which nothing adapts.
    """

    def __init__(self, time_constant_s: float, margin_px: int) -> None:
        self._tau_ns = time_constant_s * 1e9
        self._brush = disc(2 * margin_px + 1)
        self.reset()

    def reset(self) -> None:
        """Forget all stamps."""
        self._seen_ns: int | None = None
        self._followed_ns: int | None = None
        self._first_row = 0

    def pass_over(self, stamp_ns: int) -> None:
        """Note the stamp of an image from which nothing is learned.

        An image may come twice: first a region of it, then the whole image.
        """
        before, self._seen_ns = self._seen_ns, stamp_ns
        if before is None or not 0 <= stamp_ns - before <= GAP_NS:
            self._followed_ns = None
            self._first_row = 0

    def follow(
        self,
        image: Mask,
        mask: Mask,
        stamp_ns: int,
        gain: np.ndarray[tuple[int], np.dtype[np.float32]],
        mean: np.ndarray[tuple[int, ...], np.dtype[np.float32]],
        scale: np.ndarray[tuple[int, ...], np.dtype[np.float32]],
    ) -> None:
        """Adapt `mean` (k, h, w, c) to the image (h, w, c), away from the mask (h, w), in place."""
        self.pass_over(stamp_ns)
        before, self._followed_ns = self._followed_ns, stamp_ns
        if before is None:
            return
        share = 1.0 - math.exp(-STRIDE * (stamp_ns - before) / self._tau_ns)
        keep_out = np.asarray(cv2.dilate(mask, self._brush), dtype=np.uint8)
        adapt_means(image, gain, keep_out, mean, scale, np.float32(share), self._first_row, STRIDE)
        self._first_row = (self._first_row + 1) % STRIDE
