"""Keys of stored runs."""

import os
from pathlib import Path

import pytest

from markerless_tracker.benchmarks.tables.fingerprint import (
    code_files,
    file_key,
    recording_key,
    run_key,
)


def test_the_code_key_depends_on_every_source_and_body(project_root: Path) -> None:
    package = project_root / "markerless_tracker"
    names = {
        path.relative_to(package).as_posix() for path in code_files() if package in path.parents
    }
    assert names == {path.relative_to(package).as_posix() for path in package.rglob("*.py")}
    assert "tracking/tracker.py" in names
    bodies = {path.name for path in code_files() if path.suffix == ".yaml"}
    assert bodies == {path.name for path in (project_root / "config" / "bodies").iterdir()}


def test_a_run_key_depends_on_its_settings() -> None:
    assert run_key({"seed": 1, "body": "a"}) == run_key({"body": "a", "seed": 1})
    assert run_key({"seed": 1}) != run_key({"seed": 2})


def test_a_recording_key_depends_on_sizes_and_times(tmp_path: Path) -> None:
    file = tmp_path / "walk" / "cam01.mp4"
    file.parent.mkdir()
    file.write_bytes(b"one")
    os.utime(file, ns=(10**18, 10**18))
    key = recording_key(tmp_path / "walk")
    assert recording_key(tmp_path / "walk") == key
    os.utime(file, ns=(10**18, 10**18 + 1))
    assert recording_key(tmp_path / "walk") != key


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A folder with a file and a link to a folder with another."""
    (tmp_path / "walk").mkdir()
    (tmp_path / "walk" / "bag.mcap").write_text("images")
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "cam01.png").write_text("empty")
    (tmp_path / "walk" / "background").symlink_to(tmp_path / "shared")
    return tmp_path / "walk"


def test_a_recording_key_depends_on_files_in_linked_folders(walk: Path) -> None:
    key = recording_key(walk)
    (walk.parent / "shared" / "cam01.png").write_text("another one")
    assert recording_key(walk) != key


def test_a_link_to_the_folder_around_it_is_followed_once(walk: Path) -> None:
    (walk / "again").symlink_to(walk)
    assert recording_key(walk) == recording_key(walk)


@pytest.mark.parametrize("name", ["calibration.toml", "background/cam01.png", "ground_truth.trc"])
def test_the_key_of_a_bags_file_depends_on_what_is_read_beside_it(walk: Path, name) -> None:
    key = recording_key(walk / "bag.mcap")
    assert recording_key(walk / "bag.mcap") == key
    (walk / name).write_text("another one")
    assert recording_key(walk / "bag.mcap") != key


TRIALS = {
    "anipose": ("calibration/calibration.toml", "videos-raw/a_cam1.mp4", "videos-raw/a_cam2.mp4"),
    "human36m": ("metadata.xml", "Videos/Eat.54138969.mp4", "Videos/Eat.55011271.mp4"),
    "humaneva": ("Calibration_Data/C1.cal", "Image_Data/Walk_(C1).avi", "Mocap_Data/Walk.c3d"),
    "images": ("Calibration_Data/C1.cal", "Image_Data/Walk_(C1)/1.png", "Sync_Data/Walk_(C2).ofs"),
}
"""Calibration, images that name the trial and another file of it; in a session's folder."""


@pytest.mark.parametrize("names", TRIALS.values(), ids=TRIALS)
def test_the_key_of_a_trial_depends_on_the_whole_session(tmp_path: Path, names) -> None:
    session = tmp_path / "S1"
    for name in names:
        (session / name).parent.mkdir(parents=True, exist_ok=True)
        (session / name).write_text("before")
    named = session.joinpath(*Path(names[1]).parts[:2])
    key = recording_key(named)
    assert recording_key(named) == key
    for name in names[::2]:
        (session / name).write_text("afterwards")
        assert recording_key(named) != key
        key = recording_key(named)


def test_trials_of_a_session_have_keys_of_their_own(tmp_path: Path) -> None:
    for name in ("calibration/calibration.toml", "videos-raw/a_cam1.mp4", "videos-raw/b_cam1.mp4"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("content")
    one, other = (recording_key(tmp_path / "videos-raw" / f"{name}_cam1.mp4") for name in "ab")
    assert one != other


def test_a_recording_key_leaves_out_a_folder(walk: Path) -> None:
    out = walk / "out"
    key = recording_key(walk, without=out)
    out.mkdir()
    (out / "table.csv").write_text("figures")
    assert recording_key(walk, without=out) == key != recording_key(walk)


def test_the_recording_itself_is_not_left_out(walk: Path) -> None:
    key = recording_key(walk, without=walk)
    (walk / "bag.mcap").write_text("other images")
    assert recording_key(walk, without=walk) != key


def test_a_recording_key_depends_on_a_calibration_elsewhere(tmp_path: Path) -> None:
    """That of a session is shared by its trials."""
    trial = tmp_path / "session" / "trial"
    (trial / "videos").mkdir(parents=True)
    (trial / "Config.toml").write_text("[project]\n")
    shared = tmp_path / "session" / "calibration"
    shared.mkdir()
    (shared / "Calib.toml").write_text("before")
    key = recording_key(trial)
    (shared / "Calib.toml").write_text("afterwards")
    assert recording_key(trial) != key


def test_a_file_key_depends_on_the_content(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("same")
    (tmp_path / "b").write_text("same")
    assert file_key(tmp_path / "a") == file_key(tmp_path / "b") != file_key(tmp_path / "missing")
