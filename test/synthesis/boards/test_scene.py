"""Made-up boards: where they are drawn, how they move."""

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import project_camera
from markerless_tracker.camera.board import Board
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import apply
from markerless_tracker.synthesis.boards import BoardScene
from markerless_tracker.synthesis.boards.motion import BoardMotion
from markerless_tracker.synthesis.rig import ring_rig

BOARD = Board("checkerboard", 7, 4, 0.2)
SMALL = (328, 246)


@pytest.fixture(scope="module")
def scene():
    strong = (-0.22, 0.06, 0.001, -0.001, 0.0)
    return BoardScene(BOARD, cameras=2, size_px=SMALL, seconds=10.0, distortion=strong)


def test_corners_lie_where_the_true_camera_projects_them(scene) -> None:
    """Refined by OpenCV from the projected positions, they stay within a fraction of a pixel."""
    compared = 0
    for number in (0, 1, 2, 5):
        images, pose = scene.held(number), scene.motion.poses[number]
        camera = scene.rig.cameras[0]
        expected = project_camera(apply(pose, BOARD.corners_m), camera).astype(np.float32)
        if (expected < 8).any() or (expected > np.array(SMALL) - 9).any():
            continue
        grey = cv2.cvtColor(images[camera.name], cv2.COLOR_BGR2GRAY)
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
        found = cv2.cornerSubPix(grey, expected[:, None].copy(), (3, 3), (-1, -1), stop)[:, 0]
        assert np.sqrt(((found - expected) ** 2).sum(axis=1).mean()) < 0.15
        compared += 1
    assert compared >= 3


def test_the_board_lies_on_the_floor_first_and_is_held_between_moves(scene) -> None:
    np.testing.assert_array_equal(scene.pose(0), np.eye(4))
    np.testing.assert_array_equal(scene.pose(5), np.eye(4))
    poses = [scene.pose(i) for i in range(100)]
    moved = [not np.allclose(a, b, atol=1e-9) for a, b in zip(poses, poses[1:], strict=False)]
    assert 20 < sum(moved) < 90
    assert min(apply(pose, BOARD.outline_m)[:, 2].min() for pose in poses) > -1e-9


def test_the_board_moves_without_jumps() -> None:
    motion = BoardMotion(BOARD, ring_rig(2, SMALL), 40.0, 0)
    corners = [apply(motion.pose(time_s), BOARD.outline_m) for time_s in np.arange(0.0, 40.0, 4e-3)]
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=2)
    assert steps.max() < 0.08
    assert min(corner[:, 2].min() for corner in corners) > -1e-9


def test_the_back_shows_no_squares(scene) -> None:
    flipped = np.diag([1.0, -1.0, -1.0, 1.0])
    flipped[2, 3] = 1.0
    camera = scene.rig.cameras[0]
    clean = BoardScene(BOARD, cameras=2, size_px=SMALL, seconds=10.0, noise=0.0)
    front, back = (clean._images([pose], 0)[camera.name] for pose in (np.eye(4), flipped))
    assert front.min() < 40 < 60 < back[120:200].min()


def test_the_same_arguments_give_the_same_images(scene) -> None:
    again = BoardScene(
        BOARD, cameras=2, size_px=SMALL, seconds=10.0, distortion=scene.rig.cameras[0].distortion
    )
    for name, image in again.frame(17).items():
        np.testing.assert_array_equal(image, scene.frame(17)[name])


def test_impossible_scenes_are_refused() -> None:
    for words in ({"cameras": 0}, {"seconds": 0.0}, {"noise": -1.0}):
        with pytest.raises(ConfigError):
            BoardScene(BOARD, **words)
