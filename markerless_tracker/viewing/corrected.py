"""The cameras as a run corrected them."""

from collections.abc import Mapping
from typing import Any

from markerless_tracker.camera import CameraRig


def as_corrected(rig: CameraRig, full: CameraRig, summary: Mapping[str, Any]) -> CameraRig:
    """A rig with the images shifted that a run shifted.

    Args:
        rig: the cameras of images of any size.
        full: the same cameras at full size.
        summary: of the result; `cameras` has the shifts at the scale that was tracked.
    """
    scale, shifts_px = float(summary.get("scale") or 1.0), {}
    for name, entry in (summary.get("cameras") or {}).items():
        if name in rig.names and entry.get("corrected"):
            factor = rig[name].size_px[0] / (scale * full[name].size_px[0])
            u, v = entry["shift_px"]
            shifts_px[name] = (factor * u, factor * v)
    return rig.shifted(shifts_px)
