"""Empty-scene images and learned backgrounds: sources, sizes, refusals."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.bags import write_bag
from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import (
    open_recording,
    read_background,
    read_background_models,
    write_image,
)
from markerless_tracker.datasets.background import MAX_FRAMES
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.errors import DatasetError, ImageError
from markerless_tracker.imaging import (
    BackgroundModel,
    ImagingSettings,
    Mode,
    write_background_model,
)
from markerless_tracker.results.run import recording_backgrounds

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


def test_a_camera_without_any_is_omitted(tmp_path: Path, rig) -> None:
    write_image(tmp_path / "bg" / "cam02.jpg", IMAGE)
    assert list(read_background(tmp_path / "bg", rig)) == ["cam02"]


def test_stored_or_scaled_sizes_are_accepted_others_refused(tmp_path: Path, rig) -> None:
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


def test_wrong_files_are_named(tmp_path: Path, rig) -> None:
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


def learned(level: float) -> BackgroundModel:
    shape = (48, 64, 3)
    rng = np.random.default_rng(3)
    weight = np.zeros(shape[:2])
    weight[:, 8:32] = 0.25
    mode = Mode(weight, np.full(shape, 200.0), np.full(shape, 9.0))
    return BackgroundModel(level + rng.uniform(0, 4, shape), np.full(shape, 5.0), "test", (mode,))


def test_learned_models_beside_images_are_read_and_scaled(tmp_path: Path, rig) -> None:
    write_image(tmp_path / "bg" / "cam01.png", IMAGE)
    write_background_model(tmp_path / "bg" / "cam01.npz", learned(40.0))
    assert list(read_background(tmp_path / "bg", rig)) == ["cam01"]
    (model,) = read_background_models(tmp_path / "bg", rig).values()
    np.testing.assert_array_equal(model.mean, learned(40.0).mean)
    half = rig.scaled(0.5)
    with pytest.raises(ImageError, match="cam01.npz.*64x48.*expected 32x24 px"):
        read_background_models(tmp_path / "bg", half)
    stored = {"cam01": (64, 48)}
    small = read_background_models(tmp_path / "bg", half, stored_sizes_px=stored)["cam01"]
    assert small.size_px == (32, 24) and small.note == "test; scaled from 64x48 px"
    blocks = learned(40.0).mean.reshape(24, 2, 32, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(small.mean, blocks, atol=1e-4)
    np.testing.assert_allclose(small.variance, 5.0, rtol=1e-6)
    (mode,) = small.modes
    assert (mode.weight[:, 4:16] == 0.25).all() and mode.weight.sum() == 24 * 12 * 0.25
    np.testing.assert_allclose(mode.mean[:, 4:16], 200.0, rtol=1e-6)


def test_learned_models_of_other_cameras_or_damaged_are_refused(tmp_path: Path, rig) -> None:
    with pytest.raises(DatasetError, match="nowhere: no such folder"):
        read_background_models(tmp_path / "nowhere", rig)
    write_background_model(tmp_path / "bg" / "cam09.npz", learned(40.0))
    with pytest.raises(DatasetError, match="cam09.npz: cam09 is no camera, expected cam01"):
        read_background_models(tmp_path / "bg", rig)
    (tmp_path / "bg" / "cam09.npz").unlink()
    (tmp_path / "bg" / "cam01.npz").write_bytes(b"nothing")
    with pytest.raises(ImageError, match="cam01.npz"):
        read_background_models(tmp_path / "bg", rig)


def test_the_model_takes_precedence_over_the_image(make_recording) -> None:
    folder = make_recording()
    recording = open_recording(folder)
    assert recording.background_models() == {}
    write_background_model(folder / "background" / "cam01.npz", learned(40.0))
    models = recording_backgrounds(recording, ImagingSettings())
    np.testing.assert_array_equal(models["cam01"].mean, learned(40.0).mean)
    assert models["cam02"].note != "test"
    for path in (folder / "background").iterdir():
        if path.stem == "cam01" and path.suffix != ".npz":
            path.unlink() if path.is_file() else shutil.rmtree(path)
    (image,) = backgrounds_of(recording)["cam01"]
    np.testing.assert_array_equal(image, learned(40.0).image)
    assert not recording.warnings


def test_a_bag_keeps_the_learned_models(make_recording, tmp_path: Path) -> None:
    folder = make_recording()
    write_background_model(folder / "background" / "cam01.npz", learned(40.0))
    write_bag(open_recording(folder), tmp_path / "bag")
    found = open_recording(tmp_path / "bag").background_models()
    assert list(found) == ["cam01"]
    np.testing.assert_array_equal(found["cam01"].variance, learned(40.0).variance)


def test_other_cameras_may_be_ignored(tmp_path: Path, rig) -> None:
    write_image(tmp_path / "bg" / "cam9.png", IMAGE)
    write_image(tmp_path / "bg" / "cam01.png", IMAGE)
    write_background_model(tmp_path / "bg" / "cam8.npz", learned(40.0))
    write_background_model(tmp_path / "bg" / "cam02.npz", learned(40.0))
    assert set(read_background(tmp_path / "bg", rig, ignore_others=True)) == {"cam01"}
    assert set(read_background_models(tmp_path / "bg", rig, ignore_others=True)) == {"cam02"}
