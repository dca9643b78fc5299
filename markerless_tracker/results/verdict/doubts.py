"""Doubts about a run, and likely causes if nobody was found, one line each."""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.description import BodyDescription
from markerless_tracker.results.verdict.agreement import find_fault, largest_hull
from markerless_tracker.results.verdict.record import RunRecord

LEAST_OVERLAP = 0.75
"""Least overlap (median over the frames, mean over the cameras) of a good fit to real silhouettes.
With exact silhouettes it is 0.9."""
CAMERA_OVERLAP, CAMERA_RATIO = 0.60, 0.75
"""A camera contradicts the others if its overlap is below the first, and below this fraction of the
median of the others'."""
STATURES_M = (1.40, 2.10)
"""Range of plausible statures; others are doubtful."""
USUAL_STATURES_M, USUAL_OVERLAP = (1.50, 2.00), 0.85
"""Narrower range where the overlap is below the second value, since the scale may be wrong."""
COMMON_STATURES_M = (1.60, 1.90)
"""Narrowest range, where the overlap is below `LEAST_OVERLAP`."""
PROPORTION = 0.25
"""Largest deviation of a length, relative to the stature, from the body's description."""
FLOOR_M = (0.01, 0.20)
"""Range of the height of the lowest joint, an ankle, of a person standing on the floor, z = 0. The
ankle alone is at 0.06 to 0.10 m; a sole, a mat or a board adds to it. A person on a machine is
higher, so the doubt asks about it."""
_STANDING = 0.25
"""Quantile over the frames for this height: a foot stands in at least this fraction of them."""
BEYOND_M = 0.05
"""A body is too small if the silhouettes extend farther beyond it, up and down together. With the
right sizes they extend by at most 0.02 m."""


def stature_m(description: BodyDescription, body: BodyModel) -> float:
    """The stature in m that fits the summed lengths of a body."""
    fractions = {name: float(v["stature"]) for name, v in description.lengths.items()}
    return sum(body.lengths_m[name] for name in fractions) / sum(fractions.values())


def stature_is_plausible(stature: float) -> bool:
    """Whether a stature in m is that of a grown person."""
    return STATURES_M[0] <= stature <= STATURES_M[1]


def doubts_about_fit(
    record: RunRecord, description: BodyDescription, *, search_faults: bool = True
) -> list[str]:
    """Doubts about a run in which a person was tracked.

    Args:
        record: of the run.
        description: of the tracked body.
        search_faults: see `verdict_of`.
    """
    overlap = record.median_overlap
    mean = float(np.mean(list(overlap.values()))) if overlap else 1.0
    wrong = _contradicting(overlap)
    found: list[str] = []
    fault = None
    if search_faults and (wrong or mean < LEAST_OVERLAP):
        fault = find_fault(record.rig, record.samples)
        if fault is not None:
            found.append(fault.describe())
            wrong = {n: text for n, text in wrong.items() if n not in fault.cameras}
    found += wrong.values()
    if mean < LEAST_OVERLAP:
        found.append(
            f"body and silhouettes overlap by {mean:.3f}, expected {LEAST_OVERLAP:g} or more: the "
            "pose may be wrong although it is tracked; look at the calibration, the backgrounds "
            "and the subject"
        )
    found += _unused(record)
    if record.body is not None:
        found += _sizes(record.body, description, mean)
    # A body that ends at the ankles cannot fill silhouettes down to the floor.
    if fault is None and record.body is not None and _has_feet(record.body):
        found += [*_too_small(record), *_floor(record)]
    return [*found, *_static(record)]


def doubts_about_start(record: RunRecord) -> list[str]:
    """Doubts about a start pose that was given, in a run in which a person was tracked."""
    if not record.before.frames:
        return []
    return [
        f"nobody was tracked in the first {record.before.frames} frames although a start pose was "
        "given: is it of this recording and time, in metres and in the calibration's world?"
    ]


def causes_of_nobody(
    record: RunRecord, *, start_given: bool, search_faults: bool = True
) -> list[str]:
    """Why a run may have found nobody.

    Args:
        record: of the run.
        start_given: whether a start pose was given.
        search_faults: see `verdict_of`.
    """
    found = []
    for name in record.rig.names:
        seen = record.silhouettes.get(name)
        if seen is None or not seen.images:
            found.append(f"{name}: no image")
        elif 2 * seen.full > seen.images:
            found.append(
                f"{name}: silhouette over most of the image in {seen.full} of {seen.images} "
                "frames: is the background this camera's, in the same light?"
            )
    empty = [n for n, seen in record.silhouettes.items() if 2 * seen.empty > seen.images]
    if empty:
        every = len(empty) == len(record.rig)
        found.append(
            f"no silhouette in {'any camera' if every else ', '.join(empty)}: nobody is there, or "
            "the background shows the person, too (one that was learned from the recording shows "
            "a person who stands still)"
        )
    if len(record.rig) == 1 and not start_given and not found:
        found.append(
            "there is one camera: a person is found from two on; give a start pose, or add a camera"
        )
    if record.samples and not found:
        fault = find_fault(record.rig, record.samples) if search_faults else None
        # Frames in the state LOST have a pose, too.
        wrong = _contradicting(record.median_overlap)
        if fault is not None:
            found.append(fault.describe())
        elif wrong:
            found += wrong.values()
        else:
            found.append(_of_silhouettes(record, start_given))
    return found


def _of_silhouettes(record: RunRecord, start_given: bool) -> str:
    if start_given:
        return (
            "the start pose does not fit the silhouettes: is it of this recording and time, in "
            "metres and in the calibration's world? (without --start the person is searched)"
        )
    hull = largest_hull(record.rig, record.samples[0])
    if hull is None:
        return (
            "the silhouettes meet nowhere in the room: units or axes of the calibration, or the "
            "order of the cameras"
        )
    x, y = hull.points_m[:, :2].mean(axis=0)
    return (
        f"what the silhouettes show at ({x:.2f}, {y:.2f}) m, from z = {hull.low_m:.2f} to "
        f"{hull.high_m:.2f} m, is no whole person: too little of one is in view, or it is none"
    )


def _contradicting(overlap: Mapping[str, float]) -> dict[str, str]:
    """Cameras whose overlap is far below the others', and a line for each."""
    found = {}
    for name, value in overlap.items():
        others = [v for n, v in overlap.items() if n != name]
        if len(others) < 2 or value >= CAMERA_OVERLAP:
            continue
        theirs = float(np.median(others))
        if value < CAMERA_RATIO * theirs:
            found[name] = (
                f"{name} contradicts the other cameras: overlap {value:.2f}, theirs {theirs:.2f}; "
                "check its calibration, its background and its time"
            )
    return found


def _unused(record: RunRecord) -> list[str]:
    """Cameras that were left out of most poses."""
    used = {n: record.overlap[n].count if n in record.overlap else 0 for n in record.rig.names}
    poses = max(used.values())
    return [
        f"{name} was used in {count} of {poses} poses only: see its warnings, and check its images "
        "and its background"
        for name, count in used.items()
        if 2 * count < poses
    ]


def _sizes(body: BodyModel, description: BodyDescription, overlap: float) -> list[str]:
    stature = stature_m(description, body)
    low, high = STATURES_M
    if overlap < USUAL_OVERLAP:
        low, high = USUAL_STATURES_M if overlap >= LEAST_OVERLAP else COMMON_STATURES_M
    found = []
    if not low <= stature <= high:
        found.append(
            f"the body has a stature of {stature:.2f} m, expected {low:.2f} to {high:.2f} of a "
            "grown person: are the units and the scale of the calibration right, and is the "
            "subject this person's?"
        )
    odd = []
    for name, entry in description.lengths.items():
        ratio = body.lengths_m[name] / (float(entry["stature"]) * stature)
        if abs(ratio - 1.0) > PROPORTION:
            odd.append((abs(ratio - 1.0), f"{name} {body.lengths_m[name]:.2f} m ({ratio:.0%})"))
    if odd:
        listed = ", ".join(text for _, text in sorted(odd, reverse=True)[:3])
        found.append(
            f"lengths unlike those of a person of {stature:.2f} m: {listed}; are the axes and the "
            "scale of the calibration right, and is the subject this person's?"
        )
    return found


def _static(record: RunRecord) -> list[str]:
    areas = record.static.found_m2()
    if not areas:
        return []
    listed = ", ".join(f"{name} ({area:.2f} m2)" for name, area in areas.items())
    return [
        f"{listed}: silhouette beside the body that never moves: furniture or a machine that the "
        "empty scene does not show; limbs near it may be wrong"
    ]


def _has_feet(body: BodyModel) -> bool:
    return any(name.endswith("foot") for name in body.cone_names)


def _too_small(record: RunRecord) -> list[str]:
    beyond = record.beyond.median_m
    if not beyond > BEYOND_M:
        return []
    return [
        f"the silhouettes reach {1000.0 * beyond:.0f} mm beyond the body, above and below "
        "together: is the subject, or the stature given, this person's, and the scale of the "
        "calibration right? (a hat reaches beyond it, too)"
    ]


def _floor(record: RunRecord) -> list[str]:
    lowest = record.lowest_m.quantile(_STANDING)
    if not record.lowest_m.count or FLOOR_M[0] <= lowest <= FLOOR_M[1]:
        return []
    low, high = FLOOR_M
    also = "does the person stand on something" if lowest > high else "is the subject another's"
    return [
        f"the lowest joint of a standing person is at z = {lowest:.2f} m, expected {low:.2f} to "
        f"{high:.2f} m: is the floor of the calibration's world at z = 0, and z up, or {also}?"
    ]
