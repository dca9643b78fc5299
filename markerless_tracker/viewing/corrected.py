"""The cameras as a run corrected them."""

from collections.abc import Mapping
from typing import Any

from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import DatasetError


def as_corrected(rig: CameraRig, full: CameraRig, summary: Mapping[str, Any]) -> CameraRig:
    """A rig with the images shifted that a run shifted.

    Args:
        rig: the cameras of images of any size.
        full: the same cameras at full size.
        summary: of the result; `cameras` has the shifts at the scale that was tracked.

    Raises:
        DatasetError: the result has no possible scale or shifts.
    """
    shifts_px = {}
    try:
        scale = float(summary.get("scale") or 1.0)
        for name, entry in (summary.get("cameras") or {}).items():
            if name in rig.names and entry.get("corrected"):
                factor = rig[name].size_px[0] / (scale * full[name].size_px[0])
                u, v = entry["shift_px"]
                shifts_px[name] = (factor * float(u), factor * float(v))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise DatasetError(
            f"the result of {summary.get('source')}: `scale` is {summary.get('scale')!r} and "
            f"`cameras` {summary.get('cameras')!r}, expected a factor, and `shift_px` [u, v] of "
            "each corrected camera"
        ) from error
    return rig.shifted(shifts_px)
