"""Recordings of FreeMoCap and Caliscope: small files of their formats."""

import json
import tomllib
from pathlib import Path

import pytest

from markerless_tracker.camera import CameraRig, write_calibration
from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.datasets.pose2sim import match_videos
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import rodrigues_from_rotation

from .conftest import in_world_of

NAMES = ("cam_0", "cam_1")


# --- FreeMoCap


@pytest.fixture
def freemocap(make_rig, write_video, tmp_path: Path) -> Path:
    folder = tmp_path / "session_1"
    videos = folder / "synchronized_videos"
    for number in range(2):
        write_video(videos / f"Camera_00{number}_synchronized.avi", number)
    file = folder / "session_1_camera_calibration.toml"
    write_calibration(file, in_world_of(make_rig("0", "1"), units="mm"))
    with file.open("a", encoding="utf-8") as more:
        more.write("\n[metadata]\nadjusted = false\n[metadata.board]\nsquares_x = 7\n")
    return folder


def test_freemocap_videos_in_order(freemocap: Path, make_rig, check) -> None:
    assert detect_format(freemocap) == "freemocap"
    recording = open_recording(freemocap)
    check(recording, make_rig(*NAMES))
    assert recording.fps == 30.0
    assert "paired in order: 0 = Camera_000_synchronized.avi, 1 = " in recording.warnings[0]


def test_videos_in_order_of_their_numbers(make_rig, write_video, tmp_path: Path) -> None:
    names = [f"cam_{number}" for number in range(1, 12)]
    for number in range(1, 12):
        write_video(tmp_path / f"cam{number}.avi", number)
    found, notes = match_videos(tmp_path, make_rig(*names))
    assert [video.name for video in found.values()] == [f"cam{n}.avi" for n in range(1, 12)]
    assert len(notes) == 1 and "cam_2 = cam2.avi" in notes[0]


def test_freemocap_videos_that_are_named(freemocap: Path, make_rig, check) -> None:
    videos = freemocap / "synchronized_videos"
    # In the other order than by their names.
    (videos / "Camera_000_synchronized.avi").rename(videos / "right.avi")
    (videos / "Camera_001_synchronized.avi").rename(videos / "left.avi")
    info = freemocap / "session_1_recording_info.json"
    info.write_text(json.dumps({"videos": {"0": "right.avi", "1": "left.avi"}}), encoding="utf-8")
    recording = open_recording(freemocap)
    check(recording, make_rig(*NAMES))
    assert recording.warnings == ()
    info.write_text(json.dumps({"videos": {"0": "right.avi"}}), encoding="utf-8")
    with pytest.raises(DatasetError, match="recording_info.json: videos: no file of 1"):
        open_recording(freemocap)
    info.write_text(json.dumps({"videos": {"0": "r.avi", "1": "left.avi"}}), encoding="utf-8")
    with pytest.raises(DatasetError, match="r.avi: no such video, named in session_1_recording"):
        open_recording(freemocap)
    info.write_text("[", encoding="utf-8")
    with pytest.raises(DatasetError, match="session_1_recording_info.json: not a JSON file"):
        open_recording(freemocap)


def test_freemocap_rate_of_its_time_stamps(freemocap: Path) -> None:
    folder = freemocap / "synchronized_videos" / "timestamps"
    folder.mkdir()
    rows = ["frame,from_previous.framerate.hz", "0,", *(f"{i},24.8" for i in range(12)), "13,12.4"]
    table = folder / "session_1_timestamps.csv"
    table.write_text("\n".join(rows), encoding="utf-8")
    (folder / "session_1_stats.json").write_text("{}", encoding="utf-8")
    assert open_recording(freemocap).fps == 24.8
    stats = json.dumps({"framerate_stats": {"median": 23.5}})
    (folder / "session_1_stats.json").write_text(stats, encoding="utf-8")
    assert open_recording(freemocap).fps == 23.5
    assert open_recording(freemocap, input_fps=20.0).fps == 20.0
    (folder / "session_1_stats.json").unlink()
    table.write_text("\n".join([*rows[:3], "1,fast"]), encoding="utf-8")
    with pytest.raises(DatasetError, match="timestamps.csv: from_previous.framerate.hz: .*fast"):
        open_recording(freemocap)


def test_freemocap_without_one_calibration(freemocap: Path) -> None:
    file = freemocap / "session_1_camera_calibration.toml"
    (freemocap / "old_camera_calibration.toml").write_bytes(file.read_bytes())
    with pytest.raises(
        CalibrationError, match="calibrations old_camera_.*, session_1_camera_.*one"
    ):
        open_recording(freemocap)
    file.unlink()
    (freemocap / "old_camera_calibration.toml").write_text("[0", encoding="utf-8")
    with pytest.raises(CalibrationError, match="old_camera_calibration.toml: not a TOML file"):
        open_recording(freemocap)
    (freemocap / "old_camera_calibration.toml").unlink()
    assert detect_format(freemocap) is None


# --- Caliscope


def cameras_toml(rig: CameraRig, *, matrices: bool = False) -> str:
    """A camera_array.toml, as Caliscope writes it, or with rotations as matrices."""
    lines = []
    for number, camera in enumerate(rig):
        T = camera.T_cam_world
        rotation = T[:3, :3] if matrices else rodrigues_from_rotation(T[:3, :3])
        lines += [
            f"[cameras.{number}]", f"cam_id = {number}", f"size = {list(camera.size_px)}",
            "rotation_count = 0", "error = 0.4", f"matrix = {camera.matrix.tolist()}",
            f"distortions = {camera.distortion.tolist()}",
            f"translation = {T[:3, 3].tolist()}", f"rotation = {rotation.tolist()}",
            "grid_count = 30", "fisheye = false", "",
        ]  # fmt: skip
    text = "\n".join(lines)
    assert tomllib.loads(text)
    return text


@pytest.fixture
def caliscope(make_rig, write_video, tmp_path: Path) -> Path:
    workspace = tmp_path / "workspace"
    folder = workspace / "recordings" / "walking"
    for number, name in enumerate(NAMES):
        write_video(folder / f"{name}.avi", number)
    volume = workspace / "calibration" / "extrinsic" / "capture_volume"
    volume.mkdir(parents=True)
    text = cameras_toml(make_rig(*NAMES)) + "[cameras.7]\ncam_id = 7\nsize = [32, 24]\n"
    (volume / "camera_array.toml").write_text(text, encoding="utf-8")
    return folder


def array_file(recording: Path) -> Path:
    volume = Path("calibration", "extrinsic", "capture_volume")
    return recording.parents[1] / volume / "camera_array.toml"


def test_caliscope_cameras_of_the_workspace(caliscope: Path, make_rig, check) -> None:
    assert detect_format(caliscope) == "caliscope"
    recording = open_recording(caliscope)
    check(recording, make_rig(*NAMES))
    assert recording.warnings[0].endswith("cam_7 left out: no pose, or marked `ignore`")
    # Beside the videos it goes first.
    text = cameras_toml(make_rig(*NAMES), matrices=True)
    (caliscope / "camera_array.toml").write_text(text, encoding="utf-8")
    recording = open_recording(caliscope)
    check(recording, make_rig(*NAMES))
    assert recording.warnings == ()


def test_caliscope_times_say_whether_cameras_are_in_step(caliscope: Path) -> None:
    def write(times: list[str]) -> None:
        text = "\n".join(["cam_id,frame_time", *times])
        (caliscope / "timestamps.csv").write_text(text, encoding="utf-8")

    close = ["0,9.00", "1,9.01", "0,9.033", "1,9.04", "1,9.07", "0,9.066"]
    write(close)
    open_recording(caliscope)
    write([*close[:4], "1,9.10", "0,9.066"])
    with pytest.raises(DatasetError, match="frame 2 of cam_1 is 34 ms off that of cam_0"):
        open_recording(caliscope)
    write([row for row in close if row[0] == "0"])
    with pytest.raises(DatasetError, match="timestamps.csv: no times of cam_1"):
        open_recording(caliscope)
    write(["0,soon"])
    with pytest.raises(DatasetError, match="expected columns cam_id and frame_time"):
        open_recording(caliscope)
    write([*close[:4], "1,nan", "0,9.066"])
    with pytest.raises(DatasetError, match="timestamps.csv: .*frame_time is 'nan'"):
        open_recording(caliscope)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("matrix =", "K =", "cam_0: matrix is missing, expected 3 x 3 numbers"),
        ("size = [32, 24]", "size = [32]", "cam_0: size is .*expected 2 finite"),
        ("fisheye = false", "fisheye = true", "cam_0: fisheye lenses are not supported"),
        ("distortions = [", "distortions = [0.1, ", "cam_0: 6 distortion coefficients"),
        ("distortions = [", "distortions = [[], ", "cam_0: distortions is .*expected 5 finite"),
        ("rotation = [", "rotation = [[], ", "cam_0: rotation is .*expected 3 x 3 finite"),
        ("rotation =", "turned =", "no camera with rotation and translation"),
        ("[cameras.", "[views.", r"no tables \[cameras.0\]"),
        ("[cameras.0]", "[cameras.0", "cannot be read"),
    ],
)
def test_caliscope_calibrations_that_are_malformed(caliscope, old, new, message) -> None:
    file = array_file(caliscope)
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(CalibrationError, match=f"camera_array.toml: {message}"):
        open_recording(caliscope)


def test_caliscope_cameras_and_videos_that_differ(caliscope: Path) -> None:
    (caliscope / "cam_1.avi").rename(caliscope / "cam_7.avi")
    recording = open_recording(caliscope)
    assert recording.rig.names == ("cam_0",)
    assert recording.warnings[-1].endswith("cam_1 left out: calibrated, but no video")
    (caliscope / "cam_7.avi").rename(caliscope / "cam_9.avi")
    with pytest.raises(CalibrationError, match="camera_array.toml: no table of cam_9, expected"):
        open_recording(caliscope)


def test_caliscope_without_videos_or_calibration(caliscope: Path) -> None:
    for video in caliscope.glob("*.avi"):
        video.unlink()
    with pytest.raises(DatasetError, match="no video of cam_0, cam_1, expected cam_0.mp4"):
        open_recording(caliscope, format="caliscope")
    array_file(caliscope).unlink()
    with pytest.raises(CalibrationError, match="no camera_array.toml here or in calibration/"):
        open_recording(caliscope, format="caliscope")
