"""ChArUco boards whose markers are too small to read, and the exact places of corners."""

import cv2
import numpy as np
import pytest

from markerless_tracker.calibration.charuco import CharucoFinder
from markerless_tracker.calibration.detect import BoardFinder
from markerless_tracker.camera import project_camera
from markerless_tracker.camera.board import Board
from markerless_tracker.geometry import apply
from markerless_tracker.synthesis.boards import BoardScene

BOARD = Board("charuco", 10, 7, 0.12, 0.09, "4x4_50")
# With OpenCV 4.6 `BoardFinder` uses OpenCV's own search, which has to read the markers.
pytestmark = pytest.mark.skipif(
    not hasattr(cv2.aruco, "ArucoDetector"), reason="this OpenCV is older than 4.7"
)


@pytest.fixture(scope="module")
def scene():
    return BoardScene(BOARD)


def true_corners(scene, number: int, camera) -> np.ndarray:
    return project_camera(apply(scene.motion.poses[number], BOARD.corners_m), camera)


@pytest.mark.parametrize(
    ("number", "name", "side_px"), [(50, "cam02", 8.0), (41, "cam04", 11.0), (10, "cam02", 26.0)]
)
def test_corners_are_exact_in_squares_of_any_size(scene, number, name, side_px) -> None:
    camera = scene.rig[name]
    expected = true_corners(scene, number, camera)
    grid = expected.reshape(6, 9, 2)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).mean() for axis in (0, 1)]
    assert abs(min(sides) - side_px) < 0.5
    seen = BoardFinder(BOARD).find(scene.held(number)[name])
    assert seen is not None and len(seen.ids) == 54
    errors = np.linalg.norm(seen.pixels - expected[seen.ids], axis=1)
    assert np.sqrt((errors**2).mean()) < 0.04 and errors.max() < 0.12


def test_the_print_of_another_board_is_refused(scene) -> None:
    """Its squares fit, and single markers may be read; all together are others."""
    grey = cv2.cvtColor(scene.held(10)["cam02"], cv2.COLOR_BGR2GRAY)
    assert CharucoFinder(BOARD).find(grey) is not None
    other = Board("charuco", 9, 7, 0.12, 0.09, "4x4_50")
    assert CharucoFinder(other).find(grey) is None
    assert CharucoFinder(BOARD).find(grey[:, ::-1].copy()) is None, "mirrored"


def test_boards_as_they_were_printed_once_are_found() -> None:
    """Boards with even rows had a white square at the top left."""
    board = Board("charuco", 8, 6, 0.12, 0.09, "4x4_50")
    drawn = cv2.aruco.CharucoBoard((8, 6), 1.0, 0.75, cv2.aruco.getPredefinedDictionary(0))
    drawn.setLegacyPattern(True)
    print_px = np.pad(drawn.generateImage((320, 240)), 40, constant_values=255)
    seen = BoardFinder(board).find(print_px)
    assert seen is not None and len(seen.ids) == 35
    x, y = np.meshgrid(np.arange(1, 8), np.arange(1, 6))
    np.testing.assert_allclose(
        seen.pixels[np.argsort(seen.ids)],
        np.column_stack([x.ravel(), y.ravel()]) * 40 + 39.5,
        atol=0.1,
    )


def test_corners_of_a_checkerboard_are_exact() -> None:
    board = Board("checkerboard", 10, 7, 0.12)
    scene = BoardScene(board)
    camera = scene.rig["cam02"]
    seen = BoardFinder(board).find(scene.held(10)["cam02"])
    expected = project_camera(apply(scene.motion.poses[10], board.corners_m), camera)
    assert np.abs(seen.pixels - expected).max() < 0.08
