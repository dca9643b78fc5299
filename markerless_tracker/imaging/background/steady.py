"""Steadiest value of each pixel over time, and the fraction of frames that differ from it."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.imaging.images import Image


@compiled()
def steady_kernel(stack, share, steady, variance):  # type: ignore[no-untyped-def]
    """Per pixel, the mean of the frames in the shortest brightness interval that holds ``share``.

    Frames are chosen by brightness, not channel by channel, so that the result is a colour that the
    pixel had. Frames of the interval with a colour far from its mean are left out. ``variance`` is,
    per channel, the mean square deviation from the result over all frames within three times the
    interval (at least 6 grey levels).
    """
    count, height, width, channels = stack.shape
    need = max(1, int(np.ceil(share * count)))
    keys = np.empty(count, dtype=np.int32)
    rough = np.empty(channels, dtype=np.float32)
    sums = np.empty(channels, dtype=np.int64)
    for v in range(height):
        for u in range(width):
            for t in range(count):
                key = 0
                for c in range(channels):
                    key += int(stack[t, v, u, c])
                key = key * 4096 + t
                slot = t
                while slot > 0 and keys[slot - 1] > key:
                    keys[slot] = keys[slot - 1]
                    slot -= 1
                keys[slot] = key
            best = 0
            least = 1 << 30
            for first in range(count - need + 1):
                length = (keys[first + need - 1] >> 12) - (keys[first] >> 12)
                if length < least:
                    least = length
                    best = first
            tolerance = max(np.float32(6.0), np.float32(3.0) * least / channels)
            for c in range(channels):
                total = 0
                for i in range(best, best + need):
                    total += int(stack[keys[i] & 4095, v, u, c])
                rough[c] = np.float32(total) / np.float32(need)
                sums[c] = 0
            # A passing object may have the same brightness but another colour.
            kept = 0
            for i in range(best, best + need):
                t = keys[i] & 4095
                near = True
                for c in range(channels):
                    near = near and abs(np.float32(stack[t, v, u, c]) - rough[c]) <= 2.0 * tolerance
                if near:
                    kept += 1
                    for c in range(channels):
                        sums[c] += int(stack[t, v, u, c])
            for c in range(channels):
                value = np.float32(sums[c]) / np.float32(kept) if kept > 0 else rough[c]
                steady[v, u, c] = value
                square = np.float32(0.0)
                inside = 0
                for t in range(count):
                    deviation = np.float32(stack[t, v, u, c]) - value
                    if abs(deviation) <= tolerance:
                        square += deviation * deviation
                        inside += 1
                variance[v, u, c] = square / np.float32(max(inside, 1))


ALONE_SHARE = 0.2
"""Fraction of the frames that must agree if there are only clips.

It is small, so that a motionless floor that is seldom visible is preferred to a body that is often
present but never quite the same.
"""


def steady_image(
    stack: Image, *, share: float = 0.4
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Steadiest value of each pixel, and its variance.

    A pixel that moving objects cover for up to 1 - ``share`` of the time keeps the value of the
    scene behind them; a median does so up to one half. Objects that stay longer without moving
    become part of the image.

    Args:
        stack: (n, h, w, c) uint8 frames, n at most 4096.
        share: fraction of the frames that must agree.

    Returns:
        Steady value and variance, (h, w, c) float32 each, grey levels and their square.
    """
    shape = stack.shape[1:]
    steady = np.empty(shape, dtype=np.float32)
    variance = np.empty(shape, dtype=np.float32)
    steady_kernel(stack, share, steady, variance)
    return steady, variance


@kernel
def match_kernel(stack, target, tolerance, matches, total):  # type: ignore[no-untyped-def]
    """Count and sum the frames within ``tolerance`` of ``target`` in every channel."""
    count, height, width, channels = stack.shape
    for v in range(height):
        for u in range(width):
            found = 0
            for t in range(count):
                near = True
                for c in range(channels):
                    if abs(np.float32(stack[t, v, u, c]) - target[v, u, c]) > tolerance:
                        near = False
                if near:
                    found += 1
                    for c in range(channels):
                        total[v, u, c] += np.float32(stack[t, v, u, c])
            matches[v, u] = found


def matching_frames(
    stack: Image, target: NDArray[np.float32], tolerance: float
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Number of frames that agree with ``target`` (h, w, c) at each pixel, and their mean.

    Returns:
        Counts (h, w) int32, and the mean (h, w, c) float32, ``target`` where no frame agrees.
    """
    matches = np.empty(target.shape[:2], dtype=np.int32)
    total = np.zeros_like(target)
    match_kernel(stack, target, np.float32(tolerance), matches, total)
    mean = total / np.maximum(matches, 1)[:, :, None].astype(np.float32)
    return matches, np.where(matches[:, :, None] > 0, mean, target).astype(np.float32)


@kernel
def motion_kernel(stack, steady, tolerance, share, jump):  # type: ignore[no-untyped-def]
    """Fraction of the frames that differ from the steady value, and the largest single change."""
    count, height, width, channels = stack.shape
    for v in range(height):
        for u in range(width):
            away = 0
            largest = np.float32(0.0)
            for t in range(count):
                far = False
                for c in range(channels):
                    value = np.float32(stack[t, v, u, c])
                    far = far or abs(value - steady[v, u, c]) > tolerance
                    if t > 0:
                        largest = max(largest, abs(value - np.float32(stack[t - 1, v, u, c])))
                away += far
            share[v, u] = np.float32(away) / np.float32(count)
            jump[v, u] = largest


def motion(
    stack: Image, steady: NDArray[np.float32], tolerance: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """How often each pixel is covered, and how abruptly.

    Light (reflections, soft shadows) changes gradually; a body comes from one frame to the next.

    Args:
        stack: (n, h, w, c) uint8 frames in temporal order.
        steady: (h, w, c) float32, of `steady_image`.
        tolerance: largest difference of two values that count as equal, grey levels.

    Returns:
        Fraction of the frames that differ from the steady value, (h, w) float32 in 0..1, and the
        largest change from one frame to the next, (h, w) float32, grey levels.
    """
    share = np.empty(steady.shape[:2], dtype=np.float32)
    jump = np.empty_like(share)
    motion_kernel(stack, steady, np.float32(tolerance), share, jump)
    return share, jump


def thinned(frames: Iterable[Image], most: int) -> Iterator[tuple[int, Image]]:
    """At most ``most`` frames, evenly spread, of a sequence of unknown length.

    Yields (index, frame). Holds up to ``most`` frames at a time.
    """
    kept: list[tuple[int, Image]] = []
    stride = 1
    for index, frame in enumerate(frames):
        if index % stride:
            continue
        if len(kept) == most:
            kept = kept[::2]
            stride *= 2
            if index % stride:
                continue
        kept.append((index, frame))
    yield from kept
