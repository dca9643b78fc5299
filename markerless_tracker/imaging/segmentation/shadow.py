"""The shadow test: which pixels are background in a shadow (H-MCPSO Eq 12).

A shadow darkens a surface and keeps its colour: with image I and background B in HSV, a pixel is
shadow where w <= I_V / B_V <= e, I_S - B_S <= tau_S and |I_H - B_H| <= tau_H. Hue is an angle: the
difference is taken around the circle, and hue is compared only where the darkened background would
have colour. On grey cameras the ratio of brightness decides alone, in a narrower range. The paper
prints no values: the defaults are measured. A shadow is also a patch of some size, unlike a few
pixels of clothes that pass the test (`morphology.shadow_patches`; not in the paper).
"""

import numpy as np

from markerless_tracker.imaging.settings import ImagingSettings


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
