"""Which foreground pixels are only the background in a shadow (H-MCPSO Eq 12).

A shadow darkens a surface but leaves its colour: with image I and background B in HSV, a pixel is
shadow where w <= I_V / B_V <= e, I_S - B_S <= tau_S and |I_H - B_H| <= tau_H. Hue is an angle, so
the difference is taken around the circle, and it is compared only where both pixels have colour.
On grey cameras the ratio of brightness decides alone, in a narrower range. The paper prints no
values: the defaults are measured. A shadow is also a patch of some size, which a few pixels of
clothes that happen to pass are not (`morphology.foreground_mask`; not in the paper).
"""

import numba
import numpy as np

from markerless_tracker.imaging.settings import ImagingSettings


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def hue_deg(blue, green, red, value, chroma):  # type: ignore[no-untyped-def]
    """Hue in degrees, [0, 360), as OpenCV defines it; ``chroma`` = max - min > 0."""
    if value == red:
        hue = np.float32(60.0) * (green - blue) / chroma
    elif value == green:
        hue = np.float32(120.0) + np.float32(60.0) * (blue - red) / chroma
    else:
        hue = np.float32(240.0) + np.float32(60.0) * (red - green) / chroma
    if hue < np.float32(0.0):
        hue += np.float32(360.0)
    return hue


@numba.njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def is_shadow(b, g, r, mean_b, mean_g, mean_r, rule):  # type: ignore[no-untyped-def]
    """Eq 12 for one colour pixel (float32 BGR) and its background; ``rule`` of `shadow_rule`."""
    value = max(b, g, r)
    mean_value = max(mean_b, mean_g, mean_r)
    if value < rule[0] * mean_value or value > rule[1] * mean_value:
        return False
    chroma = value - min(b, g, r)
    mean_chroma = mean_value - min(mean_b, mean_g, mean_r)
    # S = chroma / value, and 0 for black.
    saturation = chroma / value if value > np.float32(0.0) else np.float32(0.0)
    mean_saturation = mean_chroma / mean_value if mean_value > np.float32(0.0) else np.float32(0.0)
    if saturation - mean_saturation > rule[2]:
        return False
    # In the dark hue is noise: it is compared where the shadowed background would have colour.
    if mean_chroma * value < rule[4] * mean_value:
        return True
    if chroma <= np.float32(0.0) or mean_chroma <= np.float32(0.0):
        return chroma == mean_chroma
    turn = abs(
        hue_deg(b, g, r, value, chroma) - hue_deg(mean_b, mean_g, mean_r, mean_value, mean_chroma)
    )
    return min(turn, np.float32(360.0) - turn) <= rule[3]


def shadow_rule(settings: ImagingSettings, *, grey: bool = False) -> tuple[np.float32, ...]:
    """(least ratio, largest ratio, tau_S, tau_H, least chroma) for `is_shadow`.

    With shadow removal off no ratio passes.
    """
    if not settings.shadow_removal:
        return tuple(np.float32(x) for x in (2.0, -1.0, 0.0, 0.0, 0.0))
    return (
        np.float32(settings.shadow_grey_value_min if grey else settings.shadow_value_min),
        np.float32(settings.shadow_grey_value_max if grey else settings.shadow_value_max),
        np.float32(settings.shadow_saturation_max),
        np.float32(settings.shadow_hue_max_deg),
        np.float32(settings.shadow_chroma_min),
    )
