"""Describes a refined calibration in lines of text."""

import numpy as np

from markerless_tracker.calibration.contours.cameras import FOCAL, POSITION, ROTATION
from markerless_tracker.calibration.contours.refine import NAMES, CameraRefinement, Refinement
from markerless_tracker.geometry import FloatArray


def describe_refinement(refinement: Refinement) -> list[str]:
    """A line for each corrected camera, one for those that agree, and one for what was used."""
    lines = [
        f"{name} corrected: {_corrected(one)}"
        for name, one in refinement.cameras.items()
        if one.corrected
    ]
    rest = {name: one for name, one in refinement.cameras.items() if not one.corrected}
    agree = [name for name, one in rest.items() if np.isfinite(one.before_px).all()]
    if agree:
        lines.append(f"{', '.join(agree)}: agree and stay as they are")
    unseen = [name for name in rest if name not in agree]
    if unseen:
        lines.append(f"{', '.join(unseen)}: never compared, since they do not see the person")
    if not refinement.anchored:
        lines.append(
            "fewer than two cameras agree: the world stays where the cameras are on average"
        )
    across = " x ".join(f"{value:.2f}" for value in refinement.extent_m)
    lines.append(
        f"from {refinement.frames} frames, as good as {refinement.independent:.1f} independent "
        f"ones; the person moves by {across} m, outlines fit to "
        f"{1000.0 * refinement.residual_m:.1f} mm"
    )
    return lines


def _corrected(one: CameraRefinement) -> str:
    turned = np.degrees(np.linalg.norm(one.change[ROTATION]))
    far = 1000.0 * np.linalg.norm(one.change[POSITION])
    text = (
        f"silhouettes ({one.before_px[0]:+.1f}, {one.before_px[1]:+.1f}) px beside the body "
        f"before, ({one.after_px[0]:+.1f}, {one.after_px[1]:+.1f}) px after; "
        f"turned by {turned:.2f} deg ({_parts(one, ROTATION, 180.0 / np.pi, 2)}), "
        f"moved by {far:.0f} mm ({_parts(one, POSITION, 1000.0, 0)}), "
        f"in %: {_parts(one, FOCAL, 100.0, 2)}"
    )
    if one.held:
        text += f"; not determined and held: {', '.join(one.held)}"
    return text


def _parts(one: CameraRefinement, part: slice, unit: float, digits: int) -> str:
    """Changes and standard deviations by name."""
    values: FloatArray = unit * np.stack([one.change[part], one.sd[part]], axis=1)
    return ", ".join(
        f"{name} {value:+.{digits}f}±{sd:.{digits}f}"
        for name, (value, sd) in zip(NAMES[part], values, strict=True)
    )
