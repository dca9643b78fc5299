"""Anipose sessions, and worlds turned upright."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel, CameraRig, write_calibration
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import detect_format, open_recording, write_image
from markerless_tracker.datasets.upright.axes import AXES, rotation_to, upright
from markerless_tracker.errors import CalibrationError, ConfigError, DatasetError
from markerless_tracker.geometry import apply, rotation_from_rodrigues, transform

NAMES = ("A", "B")


@pytest.fixture
def session(make_rig, write_video, tmp_path: Path) -> Path:
    """A session of one trial in a project."""
    folder = tmp_path / "project" / "2024-05-01"
    (folder / "calibration").mkdir(parents=True)
    write_calibration(folder / "calibration" / "calibration.toml", make_rig(*NAMES))
    with (folder / "calibration" / "calibration.toml").open("a", encoding="utf-8") as file:
        file.write("\n[metadata]\nadjusted = false\nerror = 0.3\n")
    for number, name in enumerate(NAMES):
        write_video(folder / "videos-raw" / f"walk-cam{name}.avi", number)
    (tmp_path / "project" / "config.toml").write_text(
        'project = "walks"\n[triangulation]\ncam_regex = "-cam([A-Z])$"\n', encoding="utf-8"
    )
    return folder


def test_a_session_of_one_trial(session: Path, make_rig, check) -> None:
    assert detect_format(session) == "anipose"
    recording = open_recording(session)
    check(recording, make_rig(*NAMES))
    assert recording.name == "2024-05-01_walk" and recording.fps == 30.0


def test_without_a_pattern_names_end_with_the_cameras(session: Path, make_rig, check) -> None:
    (session.parent / "config.toml").unlink()
    check(open_recording(session), make_rig(*NAMES))


def test_a_video_chooses_the_trial(session: Path, write_video, make_rig, check) -> None:
    for number, name in enumerate(NAMES):
        write_video(session / "videos-raw" / f"run-cam{name}.avi", number)
    with pytest.raises(DatasetError, match="trials run, walk, expected videos of one trial"):
        open_recording(session)
    video = session / "videos-raw" / "run-camB.avi"
    assert detect_format(video) == "anipose"
    check(open_recording(video), make_rig(*NAMES))
    (session / "videos-raw" / "run-camA.avi").unlink()
    with pytest.raises(DatasetError, match="trial 'run' has no video of A, expected one of each"):
        open_recording(video)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[triangulation", "config.toml: cannot be read: "),
        ("[triangulation]\ncam_regex = '(['", "cam_regex is .*expected a pattern"),
        ("triangulation = 3", "triangulation is 3, expected a table"),
        ("[triangulation]\ncam_regex = 'view([A-Z])|-cam([A-Z])'", "trial|video"),
        ("[triangulation]\ncam_regex = 3", "cam_regex is 3, expected a pattern"),
        ("[triangulation]\ncam_regex = 'cam'", "cam_regex is 'cam', expected one group"),
    ],
)
def test_a_malformed_config_is_named(session: Path, text: str, message: str) -> None:
    (session.parent / "config.toml").write_text(text, encoding="utf-8")
    with pytest.raises(DatasetError, match=message):
        open_recording(session)


def test_a_malformed_calibration_is_named(session: Path) -> None:
    file = session / "calibration" / "calibration.toml"
    text = file.read_text(encoding="utf-8").replace("translation", "position")
    file.write_text(text, encoding="utf-8")
    with pytest.raises(CalibrationError, match="calibration.toml: A: translation is missing"):
        open_recording(session)
    file.unlink()
    assert detect_format(session) is None


@pytest.mark.parametrize("up", AXES)
def test_the_chosen_axis_becomes_z_and_images_stay(make_rig, up: str) -> None:
    rig = make_rig(*NAMES)
    in_mm = CameraRig(
        tuple(
            CameraModel(c.name, c.size_px, c.matrix, c.distortion, _longer(c.T_cam_world))
            for c in rig
        )
    )
    turned = upright(in_mm, up=up, units="mm")
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    np.testing.assert_array_equal(rotation_to(up) @ axis, [0.0, 0.0, 1.0])
    points = np.random.default_rng(2).normal(size=(5, 3))
    for old, new in zip(rig, turned, strict=True):
        np.testing.assert_allclose(
            apply(new.T_cam_world, points @ rotation_to(up).T),
            apply(old.T_cam_world, points),
            atol=1e-12,
        )


def _longer(transform: np.ndarray) -> np.ndarray:
    changed = transform.copy()
    changed[:3, 3] *= 1000.0
    return changed


def test_convert_turns_the_world(session: Path, tmp_path: Path, make_rig) -> None:
    bag = tmp_path / "bag"
    words = ["convert", str(session), str(bag), "--up=-y", "--units", "cm"]
    assert main(words) == 0
    expected = upright(make_rig(*NAMES), up="-y", units="cm")
    for read, true in zip(open_recording(bag).rig, expected, strict=True):
        np.testing.assert_allclose(read.T_cam_world, true.T_cam_world, atol=1e-9)


def test_unknown_axes_and_units(session: Path) -> None:
    with pytest.raises(ConfigError, match="up 'w': expected one of z, -z, y"):
        open_recording(session, up="w")
    with pytest.raises(ConfigError, match="units 'inch': expected one of m, cm, mm"):
        open_recording(session, units="inch")


def test_level_cameras_and_the_person_turn_the_world(walk, tmp_path: Path) -> None:
    true = open_recording(walk).rig
    turn = transform(rotation_from_rodrigues([0.7, -1.1, 0.4]), [3.0, -2.0, 5.0])
    in_cm = CameraRig(
        tuple(
            CameraModel(c.name, c.size_px, c.matrix, c.distortion, _stated(c.T_cam_world @ turn))
            for c in true
        )
    )
    folder = tmp_path / "walk"
    shutil.copytree(walk, folder)
    write_calibration(folder / "calibration.toml", in_cm)
    recording = open_recording(folder, up="person", units="cm")
    moves = [
        new.T_world_cam @ old.T_cam_world for new, old in zip(recording.rig, true, strict=True)
    ]
    for move in moves:
        # From the true world: about z, by less than 1 degree aside, the floor kept within 8 cm.
        assert move[2, 2] > np.cos(np.deg2rad(1.0)) and abs(move[2, 3]) < 0.08
        np.testing.assert_allclose(move, moves[0], atol=1e-9)
    assert recording.warnings == ()
    # The markers move with the cameras.
    kept, moved = open_recording(folder, units="cm"), recording
    back = moved.rig.cameras[0].T_world_cam @ kept.rig.cameras[0].T_cam_world
    np.testing.assert_allclose(
        moved.ground_truth().positions_m, apply(back, kept.ground_truth().positions_m), atol=1e-9
    )


def _stated(T_cam_world: np.ndarray) -> np.ndarray:
    changed = T_cam_world.copy()
    changed[:3, 3] /= 0.01
    return changed


def test_a_world_that_nothing_turns(walk, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no moving person in 24 sets"):
        open_recording(_still(walk, tmp_path / "still"), up="person", input_fps=30.0)
    folder = tmp_path / "rolled"
    shutil.copytree(walk, folder)
    rig = open_recording(walk).rig
    rolled = [
        CameraModel(c.name, c.size_px, c.matrix, c.distortion, roll @ c.T_cam_world)
        for c, roll in zip(rig, [_roll(0.0), _roll(180.0), _roll(0.0), _roll(180.0)], strict=True)
    ]
    write_calibration(folder / "calibration.toml", CameraRig(tuple(rolled)))
    with pytest.raises(DatasetError, match="rolled: the cameras look from above, or are rolled"):
        open_recording(folder, up="person")


def _still(walk: Path, folder: Path) -> Path:
    """The recording without its person."""
    shutil.copytree(walk, folder)
    recording = open_recording(walk)
    for name, images in recording.background_frames().items():
        (folder / f"{name}.mkv").unlink()
        for index in range(3):
            write_image(folder / name / f"{index}.png", images[0])
    return folder


def _roll(angle_deg: float) -> np.ndarray:
    return transform(rotation_from_rodrigues([0.0, 0.0, np.deg2rad(angle_deg)]), np.zeros(3))
