"""Silhouettes of a person located by a hull, which decides shadows and undecided pixels.

As long as no body is known, the other views decide a view's pixels. A pixel may be the person if
the hull lies on its ray. A shadow lies on the floor: a pixel whose floor point another view sees
lit is no shadow (`evidence.floor`).
"""

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, pack_mask
from markerless_tracker.tracking.evidence.floor import (
    TESTED_RADIUS_M,
    FloorView,
    floor_points,
    lit_elsewhere,
)
from markerless_tracker.tracking.evidence.grid import FINE_M
from markerless_tracker.tracking.evidence.hull import TRUNK_DISTANCE_M, Hull

_BLOCK_PX = 2
"""The floor test is made once per block of this many rows and columns."""
_REACH_M = (-1.2, 1.0)
"""Lower and upper end of the cylinder about the trunk, from the trunk's middle. Its radius is
`TRUNK_DISTANCE_M`."""
_INSIDE = 0.8
"""Least share of a component's pixels in the cylinder's image."""
_SMALL = 0.25
"""Largest area of such a component, as a fraction of what the hull's points fall on: a larger one
may be another person, farther away."""
_FAR_PX = 1e5
"""Points projected farther than this from the image are beside the camera."""


def silhouettes_in_hull(
    observations: Mapping[str, Observation], cameras: Mapping[str, CameraModel], hull: Hull
) -> dict[str, Observation]:
    """The silhouettes of the person in a hull: `components_in_hull` of each, `decided_by_hull`.

    Args:
        observations: the views.
        cameras: the cameras by name.
        hull: where the person is.
    """
    decided = decided_by_hull(observations, cameras, hull)
    return {name: components_in_hull(seen, cameras[name], hull) for name, seen in decided.items()}


def components_in_hull(observation: Observation, camera: CameraModel, hull: Hull) -> Observation:
    """The silhouette's components that belong to the person; the same object if all do.

    A hull's points fall on them, or they are small and lie around the trunk: where one view shows
    a head or a leg in pieces, the hull of all views lacks it.
    """
    mask = observation.not_background.view(np.uint8)
    count, labels = cv2.connectedComponents(mask, connectivity=8, ltype=cv2.CV_32S)
    if count <= 2:
        return observation
    u, v = _pixels(hull.points_m, observation, camera)
    kept = np.zeros(count, dtype=np.bool_)
    kept[np.unique(labels[v, u])] = True
    kept[0] = False
    areas = np.bincount(labels.ravel(), minlength=count)
    around = np.bincount(labels[_around(hull, observation, camera)], minlength=count)
    kept |= (areas < _SMALL * areas[kept].sum()) & (around >= _INSIDE * areas)
    kept[0] = False
    if not kept.any() or kept[1:].all():
        return observation
    selected, undecided = kept[labels], observation.undecided
    return observation.with_masks(
        observation.mask & selected, None if undecided is None else undecided & selected
    )


def decided_by_hull(
    observations: Mapping[str, Observation], cameras: Mapping[str, CameraModel], hull: Hull
) -> dict[str, Observation]:
    """Observations with undecided pixels decided where the hull and the floor allow it.

    - Undecided pixels outside of the hull's image become background: other views show nobody on
      their rays.
    - Undecided pixels in the image of its sure points become person if they show no floor, or if
      their floor point is lit in another view and darkened in none. Others stay undecided.
    - Person pixels outside of the hull's image become undecided, as possible dark shadows, unless
      they show no floor or their floor point is lit in another view and darkened in none.
    """
    if all(seen.undecided_words is None for seen in observations.values()):
        return dict(observations)
    covered = {
        name: _covered(hull.points_m, seen, cameras[name], grown=True)
        for name, seen in observations.items()
    }
    views = {
        name: FloorView.of(seen, cameras[name], pack_mask(covered[name]))
        for name, seen in observations.items()
    }
    middle = hull.trunk_m.mean(axis=0)
    decided = {}
    for name, seen in observations.items():
        undecided = seen.undecided
        if undecided is None:
            undecided = np.zeros((seen.height, seen.width), dtype=np.bool_)
        sure = _covered(hull.sure_m, seen, cameras[name])
        others = [view for other, view in views.items() if other != name]
        beside = ~covered[name]
        asked = (undecided & sure) | (seen.mask & beside)
        shadow = _maybe_shadows(asked, views[name], others, middle)
        person = (seen.mask & ~shadow) | (undecided & sure & ~shadow)
        unsure = (undecided & ~person & ~beside) | (seen.mask & shadow)
        decided[name] = seen.with_masks(person, unsure)
    return decided


def _maybe_shadows(
    asked: NDArray[np.bool_], view: FloorView, others: list[FloorView], middle: FloatArray
) -> NDArray[np.bool_]:
    """Which of the given pixels (h, w) show a floor point that no other view sees lit."""
    rows, columns = np.nonzero(asked)
    if not rows.size:
        return asked
    height, width = asked.shape
    blocks = np.zeros((height // _BLOCK_PX + 1, width // _BLOCK_PX + 1), dtype=np.bool_)
    block = rows // _BLOCK_PX, columns // _BLOCK_PX
    blocks[block] = True
    tested = np.nonzero(blocks)
    corners = np.column_stack(tested[::-1]).astype(np.float64) * _BLOCK_PX
    pixels = corners + 0.5 * (_BLOCK_PX - 1)
    points = floor_points(pixels + view.offset_px, view.camera)
    points[np.linalg.norm((points - middle)[:, :2], axis=1) > TESTED_RADIUS_M] = np.nan
    blocks[tested] = np.isfinite(points).all(axis=1) & ~lit_elsewhere(points, others)
    out = np.zeros_like(asked)
    out[rows, columns] = blocks[block]
    return out


def _covered(
    points_m: FloatArray, seen: Observation, camera: CameraModel, *, grown: bool = False
) -> NDArray[np.bool_]:
    """Pixels (h, w) that the image of a hull's points covers, gaps between them closed.

    With `grown` it is dilated by about the grid's spacing, to cover the points' whole cells.
    """
    u, v = _pixels(points_m, seen, camera)
    out = np.zeros((seen.height, seen.width), dtype=np.uint8)
    if not u.size:
        return out > 0
    out[v, u] = 1
    depth = float(camera.T_cam_world[2, :3] @ points_m.mean(axis=0) + camera.T_cam_world[2, 3])
    side = 2 * int(0.75 * FINE_M * float(camera.matrix[0, 0]) / max(depth, 1.0)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    change = cv2.MORPH_DILATE if grown else cv2.MORPH_CLOSE
    return np.asarray(cv2.morphologyEx(out, change, kernel) > 0)


def _around(hull: Hull, observation: Observation, camera: CameraModel) -> NDArray[np.bool_]:
    """Pixels (h, w) of an upright cylinder about the trunk; none if the camera is next to it."""
    out = np.zeros((observation.height, observation.width), dtype=np.uint8)
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = TRUNK_DISTANCE_M * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(16)])
    middle = hull.trunk_m.mean(axis=0)
    points = np.concatenate([middle + ring + (0.0, 0.0, height_m) for height_m in _REACH_M])
    pixels = project_camera(points, camera) - observation.offset_px
    if (np.abs(pixels) < _FAR_PX).all():
        cv2.fillConvexPoly(out, cv2.convexHull(np.round(pixels).astype(np.int32)), 1)
    return out.view(np.bool_)


def _pixels(
    points_m: FloatArray, seen: Observation, camera: CameraModel
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Columns and rows, in the observation's region, of the points (n, 3) that lie in it."""
    pixels = project_camera(points_m, camera) - seen.offset_px
    with np.errstate(invalid="ignore"):
        u, v = np.round(pixels).T
        framed = (u >= 0) & (v >= 0) & (u < seen.width) & (v < seen.height)
    return u[framed].astype(np.int64), v[framed].astype(np.int64)
