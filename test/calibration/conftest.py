"""A made-up rig and the corners that it sees, without images."""

import numpy as np
import pytest

from markerless_tracker.calibration.detect import Seen
from markerless_tracker.calibration.views import BoardViews
from markerless_tracker.camera import project_camera
from markerless_tracker.camera.board import Board
from markerless_tracker.geometry import apply
from markerless_tracker.synthesis.boards.motion import BoardMotion
from markerless_tracker.synthesis.rig import ring_rig

SIZE = (656, 490)


@pytest.fixture(scope="session")
def rig():
    return ring_rig(3, SIZE)


def visible_side(pose, camera) -> bool:
    """Whether a camera looks at the print of a board at `T_world_board` (4, 4)."""
    return bool((np.linalg.inv(pose) @ camera.T_world_cam)[2, 3] > 0.0)


def seen_by(rig, board, poses, *, noise=0.03, seed=0):
    """Sets of corners of a board at poses, where all of them are in an image."""
    rng = np.random.default_rng(seed)
    sets = []
    for pose in poses:
        seen = {}
        for camera in rig:
            pixels = project_camera(apply(pose, board.corners_m), camera)
            inside = (pixels > 0).all() and (pixels < np.array(camera.size_px) - 1).all()
            if visible_side(pose, camera) and inside:
                shown = pixels + rng.normal(0.0, noise, pixels.shape)
                seen[camera.name] = Seen(np.arange(len(pixels)), shown)
        if seen:
            sets.append(seen)
    return sets


def views_of(rig, board, sets):
    sizes = {camera.name: camera.size_px for camera in rig}
    return BoardViews(board, sizes, tuple(sets), tuple(range(len(sets))), 1, len(sets))


@pytest.fixture(scope="session")
def board():
    return Board("checkerboard", 8, 5, 0.16)


@pytest.fixture(scope="session")
def views(rig, board):
    return views_of(rig, board, seen_by(rig, board, BoardMotion(board, rig, 10.0, 0).poses))


@pytest.fixture(scope="session")
def make_views():
    def make(rig, board, *, noise=0.03, seed=0):
        poses = BoardMotion(board, rig, 10.0, 0).poses
        return views_of(rig, board, seen_by(rig, board, poses, noise=noise, seed=seed))

    return make
