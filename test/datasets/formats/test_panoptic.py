"""CMU Panoptic: a small sequence of its format."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.datasets.formats import panoptic
from markerless_tracker.errors import CalibrationError, DatasetError

from .conftest import FRAMES, SIZE, TRUTH_M, changed, in_world_of, points_of


def panoptic_entry(camera: Any, name: str, kind: str = "hd") -> dict[str, Any]:
    T = camera.T_cam_world
    return {
        "name": name, "type": kind, "resolution": list(SIZE), "panel": 0, "node": 1,
        "K": camera.matrix.tolist(), "distCoef": camera.distortion.tolist(),
        "R": T[:3, :3].tolist(), "t": T[:3, 3:].tolist(),
    }  # fmt: skip


@pytest.fixture
def sequence(make_rig, write_video, tmp_path: Path) -> Path:
    folder = tmp_path / "171204_pose1"
    rig = make_rig("hd_00_03", "hd_00_10")
    stated = in_world_of(rig, up="-y", units="cm")
    cameras = [panoptic_entry(c, c.name.removeprefix("hd_")) for c in stated]
    cameras.append(panoptic_entry(stated.cameras[0], "01_01", "vga"))
    cameras.append(panoptic_entry(stated.cameras[0], "00_11"))
    for number, camera in enumerate(rig):
        write_video(folder / "hdVideos" / f"{camera.name}.avi", number)
    text = json.dumps({"calibDataSource": "", "cameras": cameras})
    (folder / "calibration_171204_pose1.json").write_text(text, encoding="utf-8")
    return folder


def write_bodies(sequence: Path, frame: int, bodies: dict[int, np.ndarray]) -> Path:
    found = [
        {"id": body, "joints19": np.column_stack([joints, np.full(19, 0.8)]).ravel().tolist()}
        for body, joints in bodies.items()
    ]
    path = sequence / "hdPose3d_stage1_coco19" / f"body3DScene_{frame:08d}.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps({"version": 0.7, "bodies": found}), encoding="utf-8")
    return path


def test_panoptic_cameras_and_joints(sequence: Path, make_rig, check) -> None:
    assert detect_format(sequence) == "panoptic"
    recording = open_recording(sequence)
    check(recording, make_rig("hd_00_03", "hd_00_10"))
    assert recording.ground_truth() is None
    stated = points_of(TRUTH_M[:, :19], up="-y", units="cm")
    for frame in range(FRAMES):
        other = {4: stated[frame] + 90.0} if frame == 1 else {}
        path = write_bodies(sequence, frame, {2: stated[frame], **other})
    content = json.loads(path.read_text(encoding="utf-8"))
    content["bodies"][0]["joints19"][4 * 3 + 3] = -1.0
    path.write_text(json.dumps(content), encoding="utf-8")
    truth = recording.ground_truth()
    assert truth.names == panoptic.JOINTS and "joints of 2 persons" in recording.warnings[0]
    assert truth.stamps_ns.tolist() == [round(i * 1e9 / 30.0) for i in range(FRAMES)]
    np.testing.assert_allclose(truth.positions_m[:2], TRUTH_M[:2, :19], atol=1e-12)
    missing = np.isnan(truth.positions_m[2]).any(axis=1)
    assert [truth.names[i] for i in np.flatnonzero(missing)] == ["LShoulder"]


def test_panoptic_images_that_begin_later(sequence: Path, write_images, make_rig, check) -> None:
    for video in (sequence / "hdVideos").iterdir():
        video.unlink()
    for number, name in enumerate(("00_03", "00_10")):
        folder = sequence / "hdImgs" / name
        write_images(folder, number, name + "_{:08d}.png")
        for file in sorted(folder.iterdir(), reverse=True):
            index = int(file.stem[-8:]) + 500
            file.rename(folder / f"{name}_{index:08d}.png")
    write_bodies(sequence, 499, {0: np.zeros((19, 3))})
    write_bodies(sequence, 501, {0: points_of(TRUTH_M[0, :19], up="-y", units="cm")})
    recording = open_recording(sequence)
    check(recording, make_rig("hd_00_03", "hd_00_10"))
    assert recording.fps == 30000.0 / 1001.0
    truth = recording.ground_truth()
    assert truth.stamps_ns.tolist() == [round(1e9 * 1001.0 / 30000.0)]
    np.testing.assert_allclose(truth.positions_m[0], TRUTH_M[0, :19], atol=1e-12)
    (sequence / "hdImgs" / "00_10" / "00_10_00000500.png").unlink()
    with pytest.raises(DatasetError, match="different frames .hd_00_03 500, hd_00_10 501"):
        open_recording(sequence)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"K":', '"KK":', r"00_03: K is missing, expected 3 x 3 numbers"),
        ('"distCoef": [-0.1,', '"distCoef": ["a",', "00_03: distCoef is .*expected 5 finite"),
        ('"cameras": [', '"cameras": 3, "x": [', "cameras is int, expected a list"),
        ('"name": "00_03"', '"title": "00_03"', "cameras 0: no name"),
        ('{"calib', '["calib', "not a JSON file"),
        ('"R": [[', '"R": [[5', "00_03: .*rotation"),
    ],
)
def test_panoptic_calibrations_that_are_malformed(sequence, old, new, message) -> None:
    changed(sequence / "calibration_171204_pose1.json", old, new)
    with pytest.raises(CalibrationError, match=f"calibration_171204_pose1.json: {message}"):
        open_recording(sequence)


def test_panoptic_joints_that_are_malformed(sequence: Path) -> None:
    path = write_bodies(sequence, 0, {0: np.zeros((19, 3))})
    changed(path, '"joints19": [', '"joints19": [1, ')
    recording = open_recording(sequence)
    with pytest.raises(DatasetError, match="00000000.json: bodies 0: expected id and joints19"):
        recording.ground_truth()
    changed(path, '"joints19": [1, ', '"joints19": [')
    changed(path, '"id": 0', '"id": []')
    with pytest.raises(DatasetError, match="00000000.json: bodies 0: expected id and joints19"):
        recording.ground_truth()
    changed(path, '"bodies": [', '"bodies": 0, "x": [')
    with pytest.raises(DatasetError, match="bodies is int, expected a list"):
        recording.ground_truth()
    for video in (sequence / "hdVideos").iterdir():
        video.unlink()
    with pytest.raises(DatasetError, match="no images of an HD camera"):
        open_recording(sequence)
