"""Which foreground pixels are only the background in a shadow (H-MCPSO Eq 12).

A shadow darkens a surface but leaves its colour: with image I and background B in HSV, a pixel is
shadow where w <= I_V / B_V <= e, I_S - B_S <= tau_S and |I_H - B_H| <= tau_H. Hue is an angle, so
the difference is taken around the circle, and it is compared only where the darkened background
would have colour.
On grey cameras the ratio of brightness decides alone, in a narrower range. The paper prints no
values: the defaults are measured. A shadow is also a patch of some size, which a few pixels of
clothes that happen to pass are not (`morphology.foreground_mask`; not in the paper).
"""

import numpy as np

from markerless_tracker.imaging.settings import ImagingSettings


def shadow_rule(settings: ImagingSettings, *, grey: bool = False) -> tuple[np.float32, ...]:
    """(least ratio, largest ratio, tau_S, tau_H, least chroma) for `kernels.is_shadow`.

    With shadow removal off no ratio passes.
    """
    if not settings.shadow.removal:
        return tuple(np.float32(x) for x in (2.0, -1.0, 0.0, 0.0, 0.0))
    return (
        np.float32(settings.shadow.grey_value_min if grey else settings.shadow.value_min),
        np.float32(settings.shadow.grey_value_max if grey else settings.shadow.value_max),
        np.float32(settings.shadow.saturation_max),
        np.float32(settings.shadow.hue_max_deg),
        np.float32(settings.shadow.chroma_min),
    )
