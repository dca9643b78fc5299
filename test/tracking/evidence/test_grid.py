"""Which points of a grid belong to the visual hull, against a slow twin."""

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.grid import (
    COARSE_M,
    FINE_M,
    LEAST_VIEWS,
    SHADOW_HEIGHT_M,
    GridViews,
    occupied,
)


@pytest.fixture(scope="module")
def seen():
    """Pelvis; cameras of two sizes, one of them near it, with person and undecided pixels."""
    scene = SyntheticScene(body="person31", motion="walk", size_px=(128, 96), seed=4)
    _, masks, _ = scene.frame(0)
    pelvis, views = scene.markers(0)[0], []
    for camera in scene.rig:
        mask = masks[camera.name] > 0
        rows = np.flatnonzero(mask.any(axis=1))
        undecided = np.zeros_like(mask)
        undecided[rows[len(rows) // 2] :] = mask[rows[len(rows) // 2] :]
        observation = Observation.from_mask(
            camera.name, 0, mask & ~undecided, np.zeros(mask.shape, np.uint8), undecided=undecided
        )
        views.append((camera, observation))
    # The first one again, 1 m from the person and with a wider image.
    placed = views[0][0].T_cam_world.copy()
    placed[:3, 3] = -placed[:3, :3] @ pelvis + (0.0, 0.0, 1.0)
    near = CameraModel("near", (140, 70), views[0][0].matrix, np.zeros(5), placed)
    full = np.ones((70, 140), dtype=np.bool_)
    full[:, :20] = False
    views.append((near, Observation.from_mask("near", 0, full, np.zeros(full.shape, np.uint8))))
    return pelvis, views


def grown(camera, observation, middle, spacing):
    """A view's classes, 0 to 2, dilated by half a spacing at the scene's middle."""
    depth = float((camera.T_cam_world @ np.append(middle, 1.0))[2])
    radius = round(0.5 * spacing * camera.matrix[0, 0] / max(depth, 1.0))
    side = 2 * radius + 1
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    classes = observation.not_background.astype(np.uint8) + observation.mask
    return cv2.dilate(classes, ellipse)


def slow(low, size, spacing, middle, views, cells):
    """The same point by point: (inside, views, person)."""
    masks = [grown(camera, observation, middle, spacing) for camera, observation in views]
    inside, person = np.zeros((2, *size), dtype=bool)
    count = np.zeros(size, dtype=int)
    for at in np.ndindex(*size):
        point = low + spacing * (np.array(at) + 0.5)
        if cells is not None:
            cell = (spacing * (np.array(at) + 0.5) / COARSE_M).astype(int)
            if not cells[tuple(np.minimum(cell, np.array(cells.shape) - 1))]:
                continue
        shown = []
        for (camera, _), mask in zip(views, masks, strict=True):
            pixel = np.round(project_camera(point[None], camera)[0])
            if np.isfinite(pixel).all() and (pixel >= 0).all() and (pixel < camera.size_px).all():
                shown.append(mask[int(pixel[1]), int(pixel[0])])
        if len(shown) < LEAST_VIEWS or 0 in shown:
            continue
        two = shown.count(2) >= LEAST_VIEWS
        if two or point[2] > SHADOW_HEIGHT_M:
            inside[at], count[at], person[at] = True, len(shown), two
    return inside, count, person


@pytest.mark.parametrize("spacing", [COARSE_M, FINE_M])
@pytest.mark.parametrize("some", [False, True])
def test_points_are_classified_as_by_the_slow_twin(seen, spacing, some) -> None:
    pelvis, views = seen
    low = np.append(pelvis[:2] - (0.25, 0.3), -0.1)
    size = np.ceil(np.array([0.5, 0.6, 1.9]) / spacing).astype(np.int64)
    cells = np.random.default_rng(6).random((3, 3, 9)) < 0.6 if some else None
    made = occupied(low, size, spacing, GridViews.of(views, pelvis), cells)
    expected = slow(low, size, spacing, pelvis, views, cells)
    inside, count, person = expected
    assert 0 < person.sum() < inside.sum() < inside.size and len(np.unique(count[inside])) > 1
    for one, other in zip(made, expected, strict=True):
        np.testing.assert_array_equal(one, other)
