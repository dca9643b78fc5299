"""Start values and bundle adjustment, on corners without images."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from markerless_tracker.calibration.bundle import (
    BOARD,
    CAMERA,
    _camera_vector,
    _covariance,
    _observations,
    _pose,
    _pose_vector,
    _position_sd_m,
    adjust,
    projection,
)
from markerless_tracker.calibration.detect import Seen
from markerless_tracker.calibration.doubts import board_doubts
from markerless_tracker.calibration.intrinsics import start_lens
from markerless_tracker.calibration.layout import start_layout
from markerless_tracker.calibration.measures import camera_measures, pair_measures
from markerless_tracker.camera.board import Board
from markerless_tracker.errors import CalibrationError


def adjusted(views):
    lenses = {name: start_lens(views, name) for name in views.sizes_px}
    return adjust(views, lenses, start_layout(views, lenses))


def worst(found, rig):
    """Focal length in %, centre in mm, direction in degrees."""
    errors = []
    for camera in found:
        true = rig[camera.name]
        cosine = float(camera.T_cam_world[2, :3] @ true.T_cam_world[2, :3])
        away = camera.T_world_cam[:3, 3] - true.T_world_cam[:3, 3]
        focal = abs(camera.matrix[0, 0] / true.matrix[0, 0] - 1.0)
        errors.append(
            (100 * focal, 1000 * np.linalg.norm(away), np.degrees(np.arccos(min(cosine, 1.0))))
        )
    return np.max(errors, axis=0)


def test_derivatives_are_those_of_the_projection(views) -> None:
    lenses = {name: start_lens(views, name) for name in views.sizes_px}
    layout = start_layout(views, lenses)
    names = list(lenses)
    data = _observations(views, names, layout)
    value = np.concatenate(
        [*(_camera_vector(lenses[n], layout.T_cam_world[n]) for n in names),
         *(_pose_vector(pose) for pose in layout.T_world_board[1:])]
    )  # fmt: skip
    value[8] = 0.01
    _, blocks = projection(value, data, len(names))
    row = int(np.flatnonzero((data.camera == 1) & (data.pose > 0))[5])
    columns = [
        *range(CAMERA, 2 * CAMERA),
        *(CAMERA * len(names) + BOARD * (data.pose[row] - 1) + k for k in range(BOARD)),
    ]
    for k, column in enumerate(columns):
        step = np.zeros_like(value)
        step[column] = 1e-6 * max(1.0, abs(value[column]))
        ahead, behind = (projection(value + s * step, data, len(names))[0][row] for s in (1, -1))
        expected = (ahead - behind) / (2.0 * step[column])
        np.testing.assert_allclose(blocks[row, :, k], expected, rtol=1e-5, atol=1e-4)


def test_the_true_cameras_are_found(views, rig) -> None:
    found = adjusted(views)
    focal, centre, direction = worst(found.rig, rig)
    assert focal < 0.2 and centre < 6.0 and direction < 0.1
    measures = camera_measures(found)
    assert all(0.03 < m.error_px < 0.06 and m.outliers == 0 for m in measures.values())
    pairs = pair_measures(found)
    assert len(pairs) == 3 and all(0.01 < p.error_px < 0.06 for p in pairs.values())


def test_wrong_corners_are_left_out(views, rig) -> None:
    sets = [dict(seen) for seen in views.sets]
    name = "cam02"
    number = next(i for i, seen in enumerate(sets) if i and name in seen)
    pixels = sets[number][name].pixels.copy()
    pixels[:6] += 9.0
    sets[number][name] = Seen(sets[number][name].ids, pixels)
    found = adjusted(replace(views, sets=tuple(sets)))
    assert camera_measures(found)[name].outliers >= 6
    assert worst(found.rig, rig)[1] < 5.0


@pytest.mark.parametrize("squares", [(8, 6), (7, 7)])
def test_symmetric_boards_are_rotated_into_agreement(make_views, rig, squares) -> None:
    """Views in any of the orders that show the same colours."""
    board = Board("checkerboard", *squares, 0.14)
    views = make_views(rig, board)
    rng = np.random.default_rng(3)
    sets = []
    for number, seen in enumerate(views.sets):
        turned = {}
        for name, view in seen.items():
            order = board.symmetries[rng.integers(len(board.symmetries)) if number else 0]
            turned[name] = Seen(view.ids, view.pixels[order])
        sets.append(turned)
    found = adjusted(replace(views, sets=tuple(sets)))
    assert camera_measures(found)["cam01"].error_px < 0.1
    # The floor's own order decides which way the world lies.
    assert worst(found.rig, rig)[1] < 6.0


def test_cameras_that_share_no_view_are_named(views) -> None:
    sets = [
        {n: s for n, s in seen.items() if (n == "cam03") == (i % 2 == 1)}
        for i, seen in enumerate([*views.sets, *views.sets])
    ]
    apart = replace(views, sets=tuple(s for s in sets if s))
    with pytest.raises(CalibrationError, match="share no view of the board with"):
        adjusted(apart)


def test_a_mirrored_camera_is_named(views) -> None:
    """Its images are flipped left to right; the corners are found in the print's order."""
    across, down = views.board.inner
    sets = []
    for seen in views.sets:
        flipped = dict(seen)
        if "cam02" in seen:
            pixels = seen["cam02"].pixels * [-1.0, 1.0] + [655.0, 0.0]
            # Black stays at the left: seen in a mirror, the board is upside down.
            grid = pixels.reshape(down, across, 2)[::-1]
            flipped["cam02"] = Seen(seen["cam02"].ids, grid.reshape(-1, 2))
        sets.append(flipped)
    with pytest.raises(CalibrationError, match="cam0. contradicts the other cameras.*mirrored"):
        adjusted(replace(views, sets=tuple(sets)))


def test_too_few_views_are_named(views) -> None:
    sets = [
        {n: s for n, s in seen.items() if n != "cam02" or i < 3}
        for i, seen in enumerate(views.sets)
    ]
    few = replace(views, sets=tuple(s for s in sets if s))
    with pytest.raises(CalibrationError, match="cam02 saw the board in [0-3] poses, expected 6"):
        adjusted(few)


def test_what_no_corner_determines_leaves_the_rest_certain() -> None:
    """A pose whose corners are all outliers has columns of zeros."""
    rng = np.random.default_rng(0)
    jacobian, errors = rng.normal(size=(40, 5)), rng.normal(size=40)
    jacobian[:, 3] = 0.0
    free = np.array([True, True, False, True, True, True])
    found = np.sqrt(np.diag(_covariance(csr_matrix(jacobian), errors, free)))
    known = np.array([0, 1, 3, 5])
    kept = np.delete(jacobian, 3, axis=1)
    variance = (errors**2).sum() / 35
    np.testing.assert_allclose(
        found[known], np.sqrt(np.diag(np.linalg.inv(kept.T @ kept)) * variance)
    )
    assert found[2] == 0.0 and found[4] == np.inf


@pytest.mark.parametrize("rows", [2, 4])
@pytest.mark.parametrize("seed", range(5))
def test_a_pose_with_few_corners_left_leaves_the_rest_certain(rows: int, seed: int) -> None:
    """The last six unknowns, of a pose, have so many rows; the others have many."""
    rng = np.random.default_rng(seed)
    jacobian = np.zeros((200 + rows, 21))
    jacobian[:, :15] = rng.normal(size=(200 + rows, 15))
    jacobian[200:, 15:] = rng.normal(size=(rows, 6))
    errors = rng.normal(size=200 + rows)
    covariance = _covariance(csr_matrix(jacobian), errors, np.ones(21, dtype=bool))
    found = np.sqrt(np.diag(covariance))
    kept = jacobian[:200, :15]
    variance = (errors**2).sum() / (errors.size - 21)
    alone = np.sqrt(np.diag(np.linalg.inv(kept.T @ kept)) * variance)
    np.testing.assert_allclose(found[:15], alone, rtol=0.05)
    assert np.isinf(found[15:]).any()


def test_the_sd_of_a_position_is_that_of_cameras_drawn_from_the_covariance() -> None:
    rng = np.random.default_rng(0)
    root = np.diag([1e-4] * 9 + [2e-3] * 3 + [8e-3] * 3) @ rng.normal(size=(15, 15))
    covariance, value = root @ root.T, np.zeros(15)
    value[9:] = 1.2, -0.7, 0.4, 0.5, -1.0, 4.0
    drawn = [
        np.linalg.inv(_pose(v[9:]))[:3, 3] for v in value + rng.normal(size=(4000, 15)) @ root.T
    ]
    np.testing.assert_allclose(_position_sd_m(value, covariance), np.std(drawn, axis=0), rtol=0.05)


def test_the_sd_of_the_position_is_the_error_of_calibrations(rig, board, make_views) -> None:
    """The translation, of the world's origin, is known much worse than the position."""
    runs = [adjusted(make_views(rig, board, noise=0.3, seed=seed)) for seed in range(6)]
    for camera in rig:
        away = [
            np.linalg.norm(run.rig[camera.name].T_world_cam[:3, 3] - camera.T_world_cam[:3, 3])
            for run in runs
        ]
        reported = np.mean([camera_measures(run)[camera.name].position_sd_mm for run in runs])
        assert 0.5 < 1000.0 * np.sqrt(np.mean(np.square(away))) / reported < 1.7


@pytest.mark.parametrize(("squares", "doubted"), [((10, 7), False), ((9, 7), True)])
def test_a_board_that_looks_the_same_upside_down_is_doubted(rig, views, squares, doubted) -> None:
    cameras = camera_measures(adjusted(views))
    found = board_doubts(Board("checkerboard", *squares, 0.12), rig, cameras, {})
    assert any("upside down: the world may be turned by half" in text for text in found) is doubted


def test_a_camera_that_is_not_determined_has_an_infinite_sd() -> None:
    covariance = np.eye(15)
    covariance[14, 14] = np.inf
    assert np.isinf(_position_sd_m(np.ones(15), covariance)).all()
