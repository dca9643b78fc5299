"""The layout of bodytrack: images, masks, `.cal` of 25 numbers, shape and start pose."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import detect_format, open_recording
from markerless_tracker.errors import CalibrationError, DatasetError

from .conftest import SIZE, cal_numbers

NAMES = ("CAM1", "CAM2")


@pytest.fixture
def sequence(make_rig, write_images, tmp_path: Path) -> Path:
    folder = tmp_path / "sequenceB"
    (folder / "CALIB").mkdir(parents=True)
    for number, model in enumerate(make_rig(*NAMES)):
        write_images(folder / model.name, number, "image{:04d}.bmp")
        cal = folder / "CALIB" / f"Camera{number + 1}.cal"
        cal.write_text(cal_numbers(model, vector=True), encoding="ascii")
    return folder


def test_images_and_cameras(sequence: Path, make_rig, check) -> None:
    assert detect_format(sequence) == "bodytrack"
    recording = open_recording(sequence)
    check(recording, make_rig(*NAMES))
    assert recording.fps == 60.0 and "taken as 60 fps" in recording.warnings[0]
    assert open_recording(sequence, input_fps=25.0).warnings == ()


def test_masks(sequence: Path) -> None:
    recording = open_recording(sequence)
    assert recording.masks("CAM1") == {}
    mask = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    mask[5:9, 3:7] = 255
    (sequence / "FG2").mkdir()
    cv2.imwrite(str(sequence / "FG2" / "image0000.bmp"), mask)
    np.testing.assert_array_equal(recording.masks("CAM2")[0], mask)
    for number in (2, 9):
        cv2.imwrite(str(sequence / "FG2" / f"image{number:04d}.bmp"), mask)
    assert list(recording.masks("CAM2")) == [0, 2]


def test_the_benchmark_of_silhouettes_reads_the_masks(sequence: Path, capsys) -> None:
    mask = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    mask[5:20, 8:18] = 255
    for number in (1, 2):
        (sequence / f"FG{number}").mkdir()
        for frame in (0, 2):
            cv2.imwrite(str(sequence / f"FG{number}" / f"image{frame:04d}.bmp"), mask)
    assert main(["benchmark", "silhouettes", str(sequence), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["exact"] and figures["frames"] == [0, 2] and set(figures["cameras"]) == {*NAMES}


def test_start_pose_and_shape(sequence: Path) -> None:
    recording = open_recording(sequence)
    assert recording.initial_pose() is None and recording.body_shape() is None
    pose = np.arange(31.0)
    (sequence / "InitialPose.txt").write_text(" ".join(map(str, pose)), encoding="ascii")
    found = recording.initial_pose()
    np.testing.assert_allclose(found[3:6], pose[3:6] / 1000.0)
    np.testing.assert_allclose(np.delete(found, [3, 4, 5]), np.delete(pose, [3, 4, 5]))
    shape = "\n".join(map(str, np.arange(58.0)))
    (sequence / "BodyShapeParameters.txt").write_text(shape, encoding="ascii")
    cones, lengths = recording.body_shape()
    assert cones.shape == (10, 4) and lengths.tolist() == list(range(40, 58))
    (sequence / "InitialPose.txt").write_text("1 2 3", encoding="ascii")
    with pytest.raises(DatasetError, match="InitialPose.txt: the start pose has 3 numbers, .*31"):
        recording.initial_pose()
    (sequence / "BodyShapeParameters.txt").write_text("a", encoding="ascii")
    with pytest.raises(DatasetError, match="BodyShapeParameters.txt: radii, scales and lengths: "):
        recording.body_shape()


def test_a_lost_image_is_named(sequence: Path) -> None:
    (sequence / "CAM2" / "image0001.bmp").unlink()
    with pytest.raises(DatasetError, match="CAM2: no image 1, but CAM1 has one"):
        open_recording(sequence)
    (sequence / "CAM1" / "image0000.bmp").unlink()
    (sequence / "CAM2" / "image0000.bmp").rename(sequence / "CAM2" / "image0001.bmp")
    (sequence / "CAM1" / "image0002.bmp").rename(sequence / "CAM1" / "image0003.bmp")
    (sequence / "CAM1" / "image0001.bmp").rename(sequence / "CAM1" / "image0002.bmp")
    warnings = open_recording(sequence, input_fps=60.0).warnings
    assert len(warnings) == 1 and "different image numbers (CAM1 2, CAM2 1)" in warnings[0]


def test_what_is_missing_is_named(sequence: Path) -> None:
    (sequence / "CALIB" / "Camera2.cal").unlink()
    with pytest.raises(CalibrationError, match="Camera2.cal: cannot be read"):
        open_recording(sequence)
    for file in (sequence / "CAM2").iterdir():
        file.unlink()
    with pytest.raises(DatasetError, match="CAM2: holds no image"):
        open_recording(sequence)
    with pytest.raises(DatasetError, match="no folder CAM1, CAM2"):
        open_recording(sequence / "CALIB", format="bodytrack")
