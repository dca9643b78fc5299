"""Empty-scene images: where they may lie, and what is refused."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import open_recording, read_background, write_image
from markerless_tracker.datasets.background import MAX_FRAMES
from markerless_tracker.errors import DatasetError, ImageError

IMAGE = np.full((48, 64, 3), 90, np.uint8)


@pytest.fixture
def rig(make_recording):
    return read_calibration(make_recording() / "calibration.toml")


def test_stills_videos_and_folders(tmp_path: Path, rig) -> None:
    write_image(tmp_path / "bg" / "cam01.png", IMAGE)
    video = cv2.VideoWriter(
        str(tmp_path / "bg" / "cam02.mp4"), int.from_bytes(b"mp4v", "little"), 10.0, (64, 48)
    )
    for _ in range(3):
        video.write(IMAGE)
    video.release()
    (tmp_path / "bg" / "notes.txt").write_text("not an image")
    found = read_background(tmp_path / "bg", rig)
    assert {name: len(images) for name, images in found.items()} == {"cam01": 1, "cam02": 3}
    (tmp_path / "bg" / "cam01.png").unlink()
    for index in range(MAX_FRAMES + 5):
        write_image(tmp_path / "bg" / "cam01" / f"{index:06d}.png", IMAGE)
    assert len(read_background(tmp_path / "bg", rig)["cam01"]) == MAX_FRAMES


def test_a_camera_without_any_is_not_there(tmp_path: Path, rig) -> None:
    write_image(tmp_path / "bg" / "cam02.jpg", IMAGE)
    assert list(read_background(tmp_path / "bg", rig)) == ["cam02"]


def test_stored_or_scaled_sizes_are_taken_others_named(tmp_path: Path, rig) -> None:
    half = rig.scaled(0.5)
    write_image(tmp_path / "bg" / "cam01.png", IMAGE)
    with pytest.raises(ImageError, match="cam01.png.*64x48.*expected 32x24 px"):
        read_background(tmp_path / "bg", half)
    stored = {"cam01": (64, 48)}
    images = read_background(tmp_path / "bg", half, stored_sizes_px=stored)["cam01"]
    assert images[0].shape == (24, 32, 3)
    write_image(tmp_path / "bg" / "cam01.png", IMAGE[:20])
    with pytest.raises(ImageError, match="64x20.*expected 64x48 or 32x24"):
        read_background(tmp_path / "bg", half, stored_sizes_px=stored)


def test_what_is_wrong_is_named(tmp_path: Path, rig) -> None:
    with pytest.raises(DatasetError, match="no such folder"):
        read_background(tmp_path / "bg", rig)
    write_image(tmp_path / "bg" / "cam9.png", IMAGE)
    with pytest.raises(DatasetError, match="cam9 is no camera, expected cam01, cam02"):
        read_background(tmp_path / "bg", rig)
    (tmp_path / "bg" / "cam9.png").rename(tmp_path / "bg" / "cam01.png")
    write_image(tmp_path / "bg" / "cam01.jpg", IMAGE)
    with pytest.raises(DatasetError, match="another background"):
        read_background(tmp_path / "bg", rig)
    (tmp_path / "bg" / "cam01.jpg").unlink()
    (tmp_path / "bg" / "cam01.png").write_bytes(b"broken")
    with pytest.raises(DatasetError, match="cam01.png"):
        read_background(tmp_path / "bg", rig)
    (tmp_path / "bg" / "cam01.png").unlink()
    (tmp_path / "bg" / "cam02").mkdir()
    with pytest.raises(DatasetError, match="cam02.*holds no image"):
        read_background(tmp_path / "bg", rig)


def test_a_recording_without_the_folder_has_none(make_recording) -> None:
    assert open_recording(make_recording(backgrounds=0)).background_frames() == {}
