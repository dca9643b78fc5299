"""Undecided pixels that the predicted body explains become person; the others stay undecided.

Three rules, the nearer to the body the less they ask for:
1. What the body covers is person, and so is the next pixel.
2. Beside the body, a pixel that cannot be a shadow on the floor is person (`evidence.floor`).
3. Beside the body, so is a patch that ends there: shadows go on.
"""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation
from markerless_tracker.tracking.evidence.floor import FloorView, floor_points, lit_elsewhere
from markerless_tracker.tracking.search import pixels_per_m

NEAR_PX = 1
"""Undecided pixels so near to the body belong to the person."""
BESIDE_M = 0.06
"""Undecided pixels so near to the body belong to the person unless they may be a shadow's."""
FLOOR_M = 3.0
"""Distance from the body of floor points that are tested: farther ones may lie behind a wall."""
_PENUMBRA_PX = 2

Mask = NDArray[np.bool_]


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
    bodies = body_masks(body, pose, [cameras[name] for name in observed])
    views = {name: _view(seen, cameras[name], bodies[name]) for name, seen in observed.items()}
    root_m = pose[[body.index(f"pelvis_t{axis}") for axis in "xyz"]]
    decided = dict(observed)
    for name in open_:
        others = [view for other, view in views.items() if other != name]
        person = _explained(views[name], others, root_m)
        seen, undecided = observed[name], views[name].undecided
        decided[name] = seen.with_masks(seen.mask | person, undecided & ~person)
    return decided


def _view(seen: Observation, camera: CameraModel, covered: Mask) -> FloorView:
    u, v = seen.offset_px
    body = np.ascontiguousarray(covered[v : v + seen.height, u : u + seen.width])
    undecided = seen.undecided
    return FloorView(
        camera,
        seen.offset_px,
        np.zeros_like(body) if undecided is None else undecided,
        ~_grown(seen.not_background, _PENUMBRA_PX),
        _grown(body, NEAR_PX, round_=True),
    )


def _explained(view: FloorView, others: list[FloorView], root_m: FloatArray) -> Mask:
    """The undecided pixels (h, w) that are person.

    Args:
        view: the view, `hidden` being what the body covers, and the next pixel.
        others: the other views.
        root_m: (3,) where the body is, m.
    """
    near = view.hidden
    person = view.undecided & near
    left, top, width, height = cv2.boundingRect(near.view(np.uint8))
    if width == 0:
        return person
    radius = max(1, round(BESIDE_M * pixels_per_m(view.camera, root_m)))
    # One pixel more, so that patches which go on are seen to do so.
    box = Region(left, top, left + width, top + height).grown(radius + 1, near.shape[::-1])
    part = box.slices
    beside = _grown(np.ascontiguousarray(near[part]), radius)
    open_ = view.undecided[part] & ~near[part]
    tested = open_ & beside
    if not tested.any():
        return person
    # One pixel of four stands for the others.
    rows, columns = 2 * np.stack(np.nonzero(tested[::2, ::2]))
    corner = np.add(view.offset_px, (box.left, box.top))
    points = floor_points(np.column_stack([columns, rows]) + corner.astype(float), view.camera)
    points[np.linalg.norm(points[:, :2] - root_m[:2], axis=1) > FLOOR_M] = np.nan
    yes = lit_elsewhere(points, others)
    found = np.zeros_like(open_)
    found[rows[yes], columns[yes]] = True
    found[1:] |= found[:-1]
    found[:, 1:] |= found[:, :-1]
    found &= tested
    person[part] |= found
    open_ &= ~found
    count, labels = cv2.connectedComponents(open_.view(np.uint8), connectivity=4)
    ends = np.ones(count, dtype=np.bool_)
    ends[labels[~beside]] = False
    ends[0] = False
    person[part] |= ends[labels]
    return person


def _grown(mask: Mask, radius: int, *, round_: bool = False) -> Mask:
    """A mask (h, w) grown by a disc or a square of that radius, px."""
    shape = cv2.MORPH_ELLIPSE if round_ else cv2.MORPH_RECT
    side = 2 * radius + 1
    kernel = cv2.getStructuringElement(shape, (side, side))
    return np.asarray(cv2.dilate(mask.view(np.uint8), kernel), dtype=np.uint8).view(np.bool_)
