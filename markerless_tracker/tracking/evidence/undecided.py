"""Undecided pixels that the predicted body explains become person; the others stay undecided.

Three rules; the nearer to the body, the less evidence they require:
1. Pixels that the body covers, and their neighbours, are person.
2. Beside the body, a pixel that cannot be a shadow on the floor is person (`evidence.floor`).
3. Beside the body, a patch that ends there is person: a shadow would continue.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.mask_words import (
    cut_words,
    flood,
    grow_square,
    has,
    spread,
    trim,
)
from markerless_tracker.fitness.raster.silhouette import body_words
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords, Observation
from markerless_tracker.tracking.evidence.floor import (
    TESTED_RADIUS_M,
    FloorView,
    floor_points,
    lit_elsewhere,
)
from markerless_tracker.tracking.search import pixels_per_m, root_m

BESIDE_M = 0.06
"""Width of the band beside the body whose undecided pixels are person unless they may be shadow."""


def decide(
    observed: Mapping[str, Observation],
    cameras: Mapping[str, CameraModel],
    body: BodyModel,
    pose: FloatArray,
) -> dict[str, Observation]:
    """Observations in which the undecided pixels that a body at a pose (p,) explains are person.

    The pose is a prior of the segmentation, after PoseCut (Bray, Kohli and Torr 2006).
    """
    open_ = [name for name, seen in observed.items() if seen.undecided_words is not None]
    if not open_:
        return dict(observed)
    bodies = body_words(body, pose, [cameras[name] for name in observed])
    views = {name: _view(seen, cameras[name], bodies[name]) for name, seen in observed.items()}
    where_m = root_m(body, pose)
    decided = dict(observed)
    for name in open_:
        others = [view for other, view in views.items() if other != name]
        person = _explained(views[name], others, where_m)
        if person.any():
            seen, undecided = observed[name], views[name].undecided
            decided[name] = replace(
                seen, mask_words=seen.mask_words | person, undecided_words=undecided & ~person
            )
    return decided


def _view(seen: Observation, camera: CameraModel, covered: MaskWords) -> FloorView:
    near = np.empty(seen.mask_words.shape, dtype=np.uint64)
    _near(covered, *seen.offset_px, seen.width, np.empty_like(near), near)
    return FloorView.of(seen, camera, near)


def _explained(view: FloorView, others: list[FloorView], where_m: FloatArray) -> MaskWords:
    """The undecided pixels that are person, packed.

    Args:
        view: the view; `hidden` are the pixels that the body covers, and their neighbours.
        others: the other views.
        where_m: (3,) the body's root, world frame.
    """
    person = view.undecided & view.hidden
    radius = max(1, round(BESIDE_M * pixels_per_m(view.camera, where_m)))
    beside, tested, away, going_on = (np.empty_like(view.hidden) for _ in range(4))
    rows = np.empty(len(tested), dtype=np.bool_)
    if not _beside(view.undecided, view.hidden, radius, view.width, beside, tested):
        return person
    if _going_on(view.undecided, beside, tested, away, rows, going_on):
        # Only patches that continue need the floor test.
        height, width = len(tested), view.width
        pixels = np.empty(((height // 2 + 1) * (width // 2 + 1), 2))
        count = _floor_pixels(view.hidden, tested, going_on, radius, width, pixels)
        pixels = pixels[:count]
        points = floor_points(pixels + view.offset_px, view.camera)
        points[np.linalg.norm(points[:, :2] - where_m[:2], axis=1) > TESTED_RADIUS_M] = np.nan
        found = pixels[lit_elsewhere(points, others)].astype(np.int64)
        _take(found, tested, person, width)
        _going_on(view.undecided, beside, tested, away, rows, going_on)
    return np.asarray(person | (tested & ~going_on))


@kernel
def _near(covered, left, top, width, window, near):  # type: ignore[no-untyped-def]
    """Fill `near` (h, k) with the pixels of a window that the body covers, and their neighbours.

    Args:
        covered: body in the frame, packed.
        left, top: of the window in the frame.
        width: of the window, px.
        window: (h, k), overwritten.
    """
    cut_words(covered, left, top, width, window)
    for v in range(near.shape[0]):
        for w in range(near.shape[1]):
            near[v, w] = spread(window, v, w)
    trim(near, width)


@kernel
def _beside(undecided, near, radius, width, beside, tested):  # type: ignore[no-untyped-def]
    """Fill `beside` with the body and the band beside it, `tested` with the undecided of the band.

    Returns whether any pixel is tested.
    """
    for v in range(near.shape[0]):
        for w in range(near.shape[1]):
            beside[v, w] = near[v, w]
    grow_square(beside, radius, width)
    anything = np.uint64(0)
    for v in range(near.shape[0]):
        for w in range(near.shape[1]):
            tested[v, w] = undecided[v, w] & beside[v, w] & ~near[v, w]
            anything |= tested[v, w]
    return anything != np.uint64(0)


@kernel
def _going_on(undecided, beside, tested, away, open_rows, out):  # type: ignore[no-untyped-def]
    """Fill `out` with tested pixels of patches that continue beyond `beside`; return if any do."""
    # Seeds are neighbours of undecided pixels beyond; the flood fills tested pixels only.
    height, count = tested.shape
    for v in range(height):
        for w in range(count):
            away[v, w] = undecided[v, w] & ~beside[v, w]
    anything = np.uint64(0)
    for v in range(height):
        for w in range(count):
            out[v, w] = tested[v, w] & spread(away, v, w)
            anything |= out[v, w]
    if anything == np.uint64(0):
        return False
    flood(out, tested, open_rows)
    return True


@kernel
def _floor_pixels(near, tested, going_on, radius, width, pixels):  # type: ignore[no-untyped-def]
    """Fill the pixels (n, 2) to which the floor test is applied; return their number.

    The test is applied to the first pixel of a block of two by two, if that is a tested pixel and
    any pixel of the block belongs to a patch that continues. Blocks begin at the top left corner of
    the band beside the body.
    """
    height, count = tested.shape
    left, top = width, height
    for v in range(height):
        for u in range(width):
            if (u & 63) == 0 and near[v, u >> 6] == np.uint64(0):
                continue
            if has(near, u, v):
                left, top = min(left, u), min(top, v)
                break
    left, top = max(0, left - radius - 1), max(0, top - radius - 1)
    found = 0
    for v in range(top, height, 2):
        if not _any_tested(tested, v):
            continue
        for u in range(left, width, 2):
            if not has(tested, u, v):
                continue
            goes = False
            for row in range(v, min(v + 2, height)):
                for column in range(u, min(u + 2, width)):
                    goes |= has(going_on, column, row)
            if goes:
                pixels[found, 0], pixels[found, 1] = u, v
                found += 1
    return found


@kernel
def _any_tested(tested, v):  # type: ignore[no-untyped-def]
    """Whether row v has a tested pixel."""
    for w in range(tested.shape[1]):
        if tested[v, w] != np.uint64(0):
            return True
    return False


@kernel
def _take(found, tested, person, width):  # type: ignore[no-untyped-def]
    """Make the tested pixels of the blocks that begin at pixels (n, 2) person."""
    for i in range(found.shape[0]):
        u, v = found[i, 0], found[i, 1]
        for row in range(v, min(v + 2, tested.shape[0])):
            for column in range(u, min(u + 2, width)):
                bit = np.uint64(1) << np.uint64(column & 63)
                person[row, column >> 6] |= tested[row, column >> 6] & bit
                tested[row, column >> 6] &= ~bit
