"""The shadow test: finds pixels that are background in a shadow (H-MCPSO Eq 12).

A shadow darkens a surface and keeps its colour: with image I and background B in HSV, a pixel is
shadow where w <= I_V / B_V <= e, I_S - B_S <= tau_S and |I_H - B_H| <= tau_H. Hue is an angle: the
difference is taken around the circle, and hue is compared only if the darkened background would
have colour. For grey cameras only the ratio of brightness decides, in a narrower range. The paper
prints no values; the defaults were measured. A shadow is also a patch of some size, unlike a few
pixels of clothes that pass the test (`morphology.shadow_patches`; not in the paper).

If shadows are undecided, the colours of patches decide, too (not in the paper). A shadow removes
the same fraction of the light from every channel, so the ratios of image to background are equal in
all of them. In a single dark pixel noise hides this: the saturation of a pixel of 80 grey levels
with a noise of 4 varies by 0.07, more than a shadow may differ. The mean of a patch has a fraction
of that noise, so it recognises shadows, and clothes that are nearly grey.
"""

from typing import TypeVar, cast

import cv2
import numpy as np

from markerless_tracker.compiled import kernel
from markerless_tracker.imaging.images import FloatImage, Image
from markerless_tracker.imaging.masks import Mask
from markerless_tracker.imaging.prefetch import ROWS_AHEAD, prefetch
from markerless_tracker.imaging.segmentation.kernels import FOREGROUND, LEVELS, SHADOW
from markerless_tracker.imaging.settings import ImagingSettings

Picture = TypeVar("Picture", Image, FloatImage)

PATCH_RADIUS_PX = 2
"""Radius of the patches whose colours are compared."""
SIDE_PX = 2 * PATCH_RADIUS_PX + 1
NOISE = 3.0
"""Additional tolerance of a patch's ratios, in standard deviations of its mean grey level."""


def shadow_rule(settings: ImagingSettings, *, grey: bool = False) -> tuple[np.float32, ...]:
    """(least ratio, largest ratio, tau_S, tau_H, least chroma) for `kernels.is_shadow`.

    Without shadow removal no ratio passes.
    """
    if not settings.shadow.removal:
        return tuple(np.float32(x) for x in (2.0, -1.0, 0.0, 0.0, 0.0))
    darkest = settings.shadow.grey_value_min if grey else settings.shadow.value_min
    faintest = settings.shadow.grey_value_max if grey else settings.shadow.value_max
    if settings.shadow.undecided:
        darkest, faintest = settings.shadow.undecided_value_min, settings.shadow.value_max
    return (
        np.float32(darkest),
        np.float32(faintest),
        np.float32(settings.shadow.saturation_max),
        np.float32(settings.shadow.hue_max_deg),
        np.float32(settings.shadow.chroma_min),
    )


def compares_patches(settings: ImagingSettings, *, grey: bool) -> bool:
    """Whether the colours of patches decide in addition to those of pixels."""
    return settings.shadow.removal and settings.shadow.undecided and not grey


def patches_radius_px(settings: ImagingSettings, *, grey: bool) -> int:
    """Radius of the colours that a label depends on through patches, px."""
    return 2 * PATCH_RADIUS_PX if compares_patches(settings, grey=grey) else 0


def patch_means(planes: Picture) -> Picture:
    """Means (c, h, w) of the square patches around the pixels of an image (c, h, w).

    Patches are mirrored at the image's border.
    """
    means = np.empty(planes.shape, dtype=planes.dtype)
    for plane, mean in zip(planes, means, strict=True):
        cv2.blur(plane, (SIDE_PX, SIDE_PX), dst=mean)
    return cast(Picture, means)


def inverse_means(means: FloatImage) -> FloatImage:
    """1 / means (c, h, w) of the patches of a background (c, h, w), grey levels."""
    inverse = 1.0 / np.maximum(patch_means(means), 1.0)
    return inverse.astype(np.float32, copy=False)


# One loop over one row, which the compiler vectorises.
@kernel
def _even_row(blue, green, red, bright_b, bright_g, bright_r, by, spread, noise, label, even):  # type: ignore[no-untyped-def]
    # No mean exceeds white.
    least = np.float32(1.0) / np.float32(255.0)
    for j in range(even.size):
        b = np.float32(blue[j]) * max(by[0] * bright_b[j], least)
        g = np.float32(green[j]) * max(by[1] * bright_g[j], least)
        r = np.float32(red[j]) * max(by[2] * bright_r[j], least)
        value = np.float32(max(blue[j], green[j], red[j]))
        most = max(b, g, r)
        alike = (most - min(b, g, r)) * value <= (spread * value + noise) * most
        even[j] = np.uint8(255) if alike & (label[j] >= SHADOW) else np.uint8(0)


@kernel
def even_patches(patch, inverse, gain, spread, noise, left, top, labels, even):  # type: ignore[no-untyped-def]
    """Find pixels that differ from the background and whose patch is equally dark in all channels.

    Args:
        patch: (3, a, b) uint8, means of the patches of a part of an image.
        inverse: (3, h, w) float32, of `inverse_means`.
        gain: (3,) float32, brightness of the image relative to the background's.
        spread: largest difference of ratios between channels, relative to the largest ratio.
        noise: additional tolerance, in grey levels of the brightest channel.
        left, top: the part's first column and row in the image.
        labels: (a, b) uint8, as of `labels.PixelLabeller`.
        even: (a, b) uint8, written: 255 or 0.
    """
    one = np.float32(1.0)
    by = (one / gain[0], one / gain[1], one / gain[2])
    columns = labels.shape[1]
    for i in range(labels.shape[0]):
        v, label = top + i, labels[i]
        # Columns without such pixels are not read from memory.
        begin, end = 0, columns
        while begin < end and label[begin] < SHADOW:
            begin += 1
        while begin < end and label[end - 1] < SHADOW:
            end -= 1
        even[i, :begin] = 0
        even[i, end:] = 0
        if i + ROWS_AHEAD < labels.shape[0]:
            for c in range(3):
                prefetch(inverse[c, v + ROWS_AHEAD, left + begin : left + end])
        _even_row(
            patch[0, i, begin:end], patch[1, i, begin:end], patch[2, i, begin:end],
            inverse[0, v, left + begin : left + end], inverse[1, v, left + begin : left + end],
            inverse[2, v, left + begin : left + end], by, spread, noise, label[begin:end],
            even[i, begin:end],
        )  # fmt: skip


# One loop over one row, which the compiler vectorises.
@kernel
def _label_row(blue, green, red, first_b, first_g, first_r, steps, rule, near, even, label):  # type: ignore[no-untyped-def]
    white = np.float32(255.0)
    for j in range(label.size):
        value = np.float32(max(blue[j], green[j], red[j]))
        base = max(
            min(steps[0] * np.float32(first_b[j]), white),
            min(steps[1] * np.float32(first_g[j]), white),
            min(steps[2] * np.float32(first_r[j]), white),
        )
        dark = (rule[0] * base <= value) & (value <= rule[1] * base)
        own = label[j]
        by_colour = np.uint8(SHADOW) if dark else own
        beside = np.uint8(FOREGROUND) if near[j] == 0 else own
        decided = beside if even[j] == 0 else by_colour
        label[j] = own if own < SHADOW else decided


@kernel
def label_by_patch(  # type: ignore[no-untyped-def]
    planes, column, row, first, gain, rule, near, even, left, top, labels
):
    """Label pixels that differ from the background as shadow or foreground, by their patches.

    A pixel as dark as a shadow is shadow if its patch is even (equally dark in all channels). At
    the border of another surface its patch is not even; there it is shadow if its own colour passes
    the test and an even patch is near.

    Args:
        planes: (3, c, d) uint8, blue, green and red of a part of an image.
        column, row: where the labels begin in it.
        first: the background, of `kernels.coarse`.
        gain, left, top: as for `even_patches`.
        rule: of `shadow.shadow_rule`.
        near, even: (a, b) uint8, whether a patch nearby is even, and whether the pixel's own is.
        labels: (a, b) uint8, changed.
    """
    level = np.float32(1.0 / LEVELS)
    steps = (gain[0] * level, gain[1] * level, gain[2] * level)
    columns = labels.shape[1]
    for i in range(labels.shape[0]):
        u, v = left, top + i
        x, y = column, row + i
        _label_row(
            planes[0, y, x : x + columns], planes[1, y, x : x + columns],
            planes[2, y, x : x + columns], first[0, 0, v, u : u + columns],
            first[0, 1, v, u : u + columns], first[0, 2, v, u : u + columns], steps, rule,
            near[i], even[i], labels[i],
        )  # fmt: skip


def near_even(even: Mask) -> Mask:
    """Mask (h, w) of the pixels within `PATCH_RADIUS_PX` of the centre of an even patch."""
    square = np.ones((SIDE_PX, SIDE_PX), dtype=np.uint8)
    return cast(Mask, cv2.dilate(even, square))
