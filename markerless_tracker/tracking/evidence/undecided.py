"""Undecided pixels that the predicted body explains become person; the others stay undecided.

Three rules; the nearer to the body, the less evidence they require:
1. What the body covers is person, and so is the next pixel.
2. Beside the body, a pixel that cannot be a shadow on the floor is person (`evidence.floor`).
3. Beside the body, so is a patch that ends there: shadows continue.
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
from markerless_tracker.observation import locked
from markerless_tracker.records import MaskWords, Observation
from markerless_tracker.tracking.evidence.floor import FloorView, floor_points, lit_elsewhere
from markerless_tracker.tracking.search import pixels_per_m, root_m

BESIDE_M = 0.06
"""Undecided pixels so near to the body belong to the person unless they may be a shadow's."""
FLOOR_M = 3.0
"""Distance from the body of floor points that are tested: farther ones may lie behind a wall."""


def decide(
    observed: Mapping[str, Observation],
    cameras: Mapping[str, CameraModel],
    body: BodyModel,
    pose: FloatArray,
) -> dict[str, Observation]:
    """Observations whose undecided pixels that a body at a pose (p,) explains are person.

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
    undecided = seen.undecided_words
    if undecided is None:
        undecided = locked(np.zeros_like(seen.mask_words), np.uint64)
    near = np.empty(seen.mask_words.shape, dtype=np.uint64)
    _near(covered, *seen.offset_px, seen.width, np.empty_like(near), near)
    return FloorView(camera, seen.offset_px, seen.width, seen.mask_words, undecided, near)


def _explained(view: FloorView, others: list[FloorView], where_m: FloatArray) -> MaskWords:
    """The undecided pixels that are person, packed.

    Args:
        view: the view, `hidden` being what the body covers, and the next pixel.
        others: the other views.
        where_m: (3,) where the body is, world frame.
    """
    person = view.undecided & view.hidden
    radius = max(1, round(BESIDE_M * pixels_per_m(view.camera, where_m)))
    beside, tested, away, going_on = (np.empty_like(view.hidden) for _ in range(4))
    rows = np.empty(len(tested), dtype=np.bool_)
    if not _beside(view.undecided, view.hidden, radius, view.width, beside, tested):
        return person
    if _going_on(view.undecided, beside, tested, away, rows, going_on):
        # Patches that end there are person whatever the floor test says.
        height, width = len(tested), view.width
        pixels = np.empty(((height // 2 + 1) * (width // 2 + 1), 2))
        count = _floor_pixels(view.hidden, tested, going_on, radius, width, pixels)
        pixels = pixels[:count]
        points = floor_points(pixels + view.offset_px, view.camera)
        points[np.linalg.norm(points[:, :2] - where_m[:2], axis=1) > FLOOR_M] = np.nan
        found = pixels[lit_elsewhere(points, others)].astype(np.int64)
        _take(found, tested, person, width)
        _going_on(view.undecided, beside, tested, away, rows, going_on)
    return np.asarray(person | (tested & ~going_on))


@kernel
def _near(covered, left, top, width, window, near):  # type: ignore[no-untyped-def]
    """Fill `near` (h, k) with a window of what the body covers, and the next pixel.

    Args:
        covered: words of the frame.
        left, top: of the window in the frame.
        width: of the window, px.
        window: (h, k), changed.
    """
    cut_words(covered, left, top, width, window)
    for v in range(near.shape[0]):
        for w in range(near.shape[1]):
            near[v, w] = spread(window, v, w)
    trim(near, width)


@kernel
def _beside(undecided, near, radius, width, beside, tested):  # type: ignore[no-untyped-def]
    """Fill what lies beside the body, with the body, and which of it is undecided; if any is."""
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
    """Fill `out` with the tested pixels of patches that go on beyond `beside`; if there are any."""
    # Neighbours across the boundary begin; the flood stays within what is tested.
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
    """Fill the pixels (n, 2) to which the floor test is applied; returns their number.

    One pixel of four stands for the others: the first of a block of two by two, from the corner of
    what lies beside the body on, if any pixel of the block is of a patch that continues beyond it.
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
    """Whether a row holds a bit."""
    for w in range(tested.shape[1]):
        if tested[v, w] != np.uint64(0):
            return True
    return False


@kernel
def _take(found, tested, person, width):  # type: ignore[no-untyped-def]
    """Take the tested pixels of the blocks that begin at pixels (n, 2): they are person."""
    for i in range(found.shape[0]):
        u, v = found[i, 0], found[i, 1]
        for row in range(v, min(v + 2, tested.shape[0])):
            for column in range(u, min(u + 2, width)):
                bit = np.uint64(1) << np.uint64(column & 63)
                person[row, column >> 6] |= tested[row, column >> 6] & bit
                tested[row, column >> 6] &= ~bit
