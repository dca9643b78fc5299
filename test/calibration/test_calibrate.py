"""From images of a made-up board to cameras, and what is refused."""

import cv2
import numpy as np
import pytest

from markerless_tracker.calibration.calibrate import calibrate
from markerless_tracker.calibration.detect import BoardFinder
from markerless_tracker.calibration.pictures import coverage_picture, layout_picture
from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.camera.board import Board
from markerless_tracker.camera.model import nominal_camera
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import FrameSet, Recording
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import apply
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.synthesis.boards import BoardScene

from .conftest import visible_side

SIZE = (410, 306)
BOARD = Board("checkerboard", 10, 7, 0.16)


class Stills(Recording):
    """Sets of images in memory, under nominal cameras."""

    def __init__(self, path, sets):
        rig = CameraRig(
            tuple(nominal_camera(n, (i.shape[1], i.shape[0])) for n, i in sets[0].items())
        )
        super().__init__(path, rig, scale=1.0, fps=1.0, frame_count=len(sets))
        self.sets = sets

    def _nearest(self, stamp_ns):
        raise NotImplementedError

    def _read(self, start, every):
        for index in range(start, len(self.sets), every):
            yield FrameSet(index, index * 10**9, self.sets[index])


@pytest.fixture(scope="module")
def scene():
    return BoardScene(BOARD, size_px=SIZE, seconds=10.0, noise=2.0)


@pytest.fixture(scope="module")
def stills(scene):
    """The board on the floor four times, then in poses in which it is held.

    Images of its back, and of parts of it, are left grey: they cost time only.
    """
    sets = [_room_lit(scene, 0, noise) for noise in range(4)]
    return sets + [_room_lit(scene, i, 0) for i in _chosen(scene)]


def _chosen(scene):
    """Numbers of poses: every second, and the last, in the middle, all."""
    count = len(scene.motion.poses)
    return [i for i in range(1, count) if i % 2 or i > count - 12]


def _room_lit(scene, number, noise):
    pose = scene.motion.poses[number]
    shown = {}
    images = scene._images([pose], 100 * noise + number)
    for camera in scene.rig:
        pixels = project_camera(apply(pose, BOARD.corners_m), camera)
        inside = (pixels > 0).all() and (pixels < np.array(SIZE) - 1).all()
        seen = visible_side(pose, camera) and inside
        grey = np.full_like(images[camera.name], 90)
        shown[camera.name] = images[camera.name] if seen else grey
    return shown


@pytest.fixture(scope="module")
def parts():
    """What the calibration told of its progress, in order."""
    return []


@pytest.fixture(scope="module")
def found(stills, tmp_path_factory, parts):
    return calibrate(
        Stills(tmp_path_factory.mktemp("board"), stills), BOARD, thickness_m=0.02,
        progress=lambda done, total: parts.append((done, total)),
        adjusting=lambda: parts.append("adjusting"),
    )  # fmt: skip


def test_the_search_is_told_step_by_step_then_the_adjustment(found, parts, stills) -> None:
    assert parts[-1] == "adjusting" and len(parts) == 1 + len(stills)


def test_the_true_cameras_are_found(found, scene) -> None:
    for camera in found.rig:
        true = scene.rig[camera.name]
        for axis in (0, 1):
            assert abs(camera.matrix[axis, axis] / true.matrix[axis, axis] - 1.0) < 0.003
        # The print lies 2 cm above the floor.
        centre = true.T_world_cam[:3, 3] + [0.0, 0.0, 0.02]
        assert np.linalg.norm(camera.T_world_cam[:3, 3] - centre) < 0.004
        cosine = camera.T_cam_world[2, :3] @ true.T_cam_world[2, :3]
        assert np.degrees(np.arccos(min(cosine, 1.0))) < 0.1
    assert found.views.floor_sets == 4 and found.views.indices[0] == 0
    assert not [text for text in found.doubts if "focal" in text or "height" in text]


def test_pictures_show_corners_and_cameras(found, scene) -> None:
    name = "cam02"
    picture = coverage_picture(found.bundle, name, found.cameras[name])
    assert picture.shape == (306, 410, 3) and (picture == (170, 90, 20)).all(axis=2).sum() > 200
    layout = layout_picture(found.rig, found.bundle.boards, BOARD.outline_m)
    assert (layout == (170, 90, 20)).all(axis=2).sum() > 300


def test_names_of_cameras_do_not_cover_what_they_see() -> None:
    rig = ring_rig(4)
    picture = layout_picture(rig, (np.eye(4),), BOARD.outline_m)
    blue = (picture == (170, 90, 20)).all(axis=2).astype(np.uint8)
    ink = (picture < 140).all(axis=2)
    dots = cv2.connectedComponentsWithStats(cv2.erode(blue, np.ones((5, 5), np.uint8)))[3][1:]
    assert len(dots) == len(rig)
    for x, y in dots.astype(int):
        above = ink[y - 26 : y - 8, x - 60 : x + 60].sum()
        below = ink[y + 8 : y + 30, x - 60 : x + 60].sum()
        assert (below > above) == (y > picture.shape[0] / 2), (x, y)


def test_a_board_of_another_size_is_named(stills, tmp_path) -> None:
    with pytest.raises(CalibrationError, match="found a board of 10x7 squares, expected 9x6"):
        calibrate(Stills(tmp_path, stills[:6]), Board("checkerboard", 9, 6, 0.16))


def test_a_checkerboard_instead_of_a_charuco_board_is_named(stills, tmp_path) -> None:
    wanted = Board("charuco", 10, 7, 0.16, 0.12, "4x4_50")
    with pytest.raises(CalibrationError, match=r"squares, expected a charuco .* no checkerboard"):
        calibrate(Stills(tmp_path, stills[:6]), wanted)


@pytest.mark.parametrize("number", [-1, 3, 99999])
def test_a_floor_frame_that_is_not_there_is_refused_at_once(stills, tmp_path, number) -> None:
    def searched(done, total):
        raise AssertionError("nothing was to be searched")

    with pytest.raises(CalibrationError, match=rf"no frame {number}, expected 0 to 2"):
        calibrate(Stills(tmp_path, stills[:3]), BOARD, floor_frame=number, progress=searched)


def test_fewer_sets_than_a_camera_needs_views_are_refused(tmp_path, capsys) -> None:
    words = ["calibrate", str(tmp_path), "-o", str(tmp_path / "out.toml"), "--sets", "5"]
    assert main(words) == 1
    assert "--sets is 5, expected 6 or more" in capsys.readouterr().err


def test_a_camera_without_a_board_is_named(stills, tmp_path) -> None:
    blind = [{**s, "cam03": np.full_like(s["cam03"], 90)} for s in stills[:3]]
    with pytest.raises(CalibrationError, match="cam03 saw no board in 3 images"):
        calibrate(Stills(tmp_path, blind), BOARD)


def test_a_grid_beside_the_board_is_refused(scene) -> None:
    """Four columns of a board of five have their colours; the border is white."""
    finder = BoardFinder(BOARD)
    camera = scene.rig.cameras[0]
    seen = finder.find(scene.held(1)[camera.name])
    expected = project_camera(apply(scene.motion.poses[1], BOARD.corners_m), camera)
    assert np.abs(seen.pixels - expected).max() < 0.4
    from markerless_tracker.calibration.detect import _colours_agree

    grey = cv2.cvtColor(scene.held(1)[camera.name], cv2.COLOR_BGR2GRAY)
    grid = seen.pixels.reshape(6, 9, 2)
    assert _colours_agree(grey, grid) and not _colours_agree(grey, grid[::-1, ::-1])
    beside = np.concatenate([grid[:, 1:], 2 * grid[:, -1:] - grid[:, -2:-1]], axis=1)
    assert not _colours_agree(grey, beside[:, ::-1])


@pytest.mark.skipif(not hasattr(cv2, "aruco"), reason="this OpenCV has no ArUco")
def test_a_charuco_board_is_found_where_it_is() -> None:
    board = Board("charuco", 7, 5, 0.16, 0.12, "4x4_50")
    scene = BoardScene(board, cameras=1, seconds=10.0)
    seen = BoardFinder(board).find(scene.held(1)["cam01"])
    pose, camera = scene.motion.poses[1], scene.rig.cameras[0]
    expected = project_camera(apply(pose, board.corners_m), camera)[seen.ids]
    assert len(seen.ids) >= 12 and np.abs(seen.pixels - expected).max() < 0.5
