"""Writing recordings: lossless videos round-trip, and a failure leaves no folder."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import MarkerTrack, new_folder, new_recording, open_recording
from markerless_tracker.errors import DatasetError, ImageError


@pytest.fixture
def rig(make_recording):
    return read_calibration(make_recording() / "calibration.toml")


def images_of(rig, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {name: rng.integers(0, 256, (48, 64, 3), dtype=np.uint8) for name in rig.names}


@pytest.mark.parametrize("lossless", [True, False])
def test_what_is_written_is_read(tmp_path: Path, rig, lossless: bool) -> None:
    smooth = np.full((48, 64, 3), 120, np.uint8)
    mask = np.zeros((48, 64), np.uint8)
    mask[5:10, 5:10] = 255
    truth = MarkerTrack(("Head",), np.array([0, 33333333]), np.ones((2, 1, 3)))
    with new_recording(tmp_path / "made", rig, 30.0, lossless=lossless) as out:
        for seed in range(2):
            images = images_of(rig, seed) if lossless else dict.fromkeys(rig.names, smooth)
            out.write(images, masks={"cam01": mask})
        out.write_background("cam01", [smooth])
        out.write_background("cam02", [smooth, smooth])
        out.write_truth(truth)
    recording = open_recording(tmp_path / "made")
    assert (recording.fps, recording.frame_count) == (30.0, 2)
    for seed, read in enumerate(recording.frames()):
        for name in rig.names:
            if lossless:
                np.testing.assert_array_equal(read.images[name], images_of(rig, seed)[name])
            else:
                assert np.abs(read.images[name].astype(int) - 120).max() < 8
    found = recording.background_frames()
    assert [len(found[name]) for name in rig.names] == [1, 2]
    assert sorted(recording.masks("cam01")) == [0, 1]
    assert np.array_equal(recording.masks("cam01")[1], mask)
    assert recording.ground_truth().stamps_ns.tolist() == [0, 33333333]


def test_grey_images_are_written_too(tmp_path: Path, rig) -> None:
    grey = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64).astype(np.uint8)
    with new_recording(tmp_path / "made", rig, 30.0, lossless=True) as out:
        out.write(dict.fromkeys(rig.names, grey))
    read = next(open_recording(tmp_path / "made").frames()).images["cam01"]
    np.testing.assert_array_equal(read, np.dstack([grey] * 3))


def test_images_of_another_size_and_odd_sizes_are_refused(tmp_path: Path, rig) -> None:
    images = images_of(rig, 0)
    with new_recording(tmp_path / "made", rig, 30.0) as out:
        with pytest.raises(DatasetError, match="cam02"):
            out.write({"cam01": images["cam01"]})
        with pytest.raises(ImageError, match="cam02.*64x40.*64x48"):
            out.write({**images, "cam02": images["cam02"][:40]})
    odd = rig["cam01"].resized((63, 48))
    with pytest.raises(DatasetError, match="cam01.*63x48"):
        with new_recording(tmp_path / "odd", type(rig)((odd,)), 30.0):
            pass
    assert not (tmp_path / "odd").exists()


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error):
        with new_folder(tmp_path / "deep" / "out") as folder:
            (folder / "file").write_text("half")
            raise error
    assert list((tmp_path / "deep").iterdir()) == []


def test_existing_targets_are_refused_and_not_changed(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("keep")
    (tmp_path / "file").write_text("keep")
    for name in ("full", "file"):
        with pytest.raises(DatasetError, match=f"{name}: exists"), new_folder(tmp_path / name):
            pass
    with pytest.raises(DatasetError, match="cannot be created"), new_folder(tmp_path / "file/x"):
        pass
    assert (tmp_path / "full" / "mine").read_text() == "keep"
    (tmp_path / "empty").mkdir()
    with new_folder(tmp_path / "empty") as folder:
        (folder / "new").write_text("here")
    assert (tmp_path / "empty" / "new").read_text() == "here"


def test_a_grey_cameras_background_has_the_channels_of_its_video(tmp_path: Path, rig) -> None:
    grey = {name: np.full((48, 64), 90, np.uint8) for name in rig.names}
    with new_recording(tmp_path / "grey", rig, 30.0, lossless=True) as out:
        out.write(grey)
        for name, image in grey.items():
            out.write_background(name, [image, image])
    recording = open_recording(tmp_path / "grey")
    (images,) = recording.frames()
    for name, model in recording.background_frames().items():
        assert model[0].shape == images.images[name].shape == (48, 64, 3)


def test_a_replacement_that_fails_keeps_the_old_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where folders cannot be exchanged at once, and the second of two moves fails."""
    bag, rename = tmp_path / "bag", Path.rename
    bag.mkdir()
    (bag / "metadata.yaml").write_text("old")

    def full(self: Path, target: Path) -> Path:
        if Path(target) == bag and self.name == bag.name:
            raise OSError(28, "No space left on device", str(self))
        return rename(self, target)

    monkeypatch.setattr("markerless_tracker.datasets.target._exchanged", lambda *_: False)
    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(DatasetError, match=f"^{bag}: .*No space left"):
        with new_folder(bag, replace=True) as new:
            (new / "metadata.yaml").write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]
    assert (bag / "metadata.yaml").read_text() == "old"


def test_another_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="missing: cannot be read or written: No such file"):
        with new_folder(tmp_path / "out"):
            (tmp_path / "missing").read_text()


@pytest.mark.parametrize("lossless", [True, False])
def test_videos_that_a_full_disk_cut_are_refused(
    tmp_path: Path, rig, monkeypatch: pytest.MonkeyPatch, lossless: bool
) -> None:
    with pytest.raises(DatasetError, match=r"cam01\..*: not all 3 frames were written"):
        with new_recording(tmp_path / "made", rig, 30.0, lossless=lossless) as out:
            for seed in range(3):
                out.write(images_of(rig, seed))
            out.close()
            cut = next(out.folder.glob("cam01.*"))
            cut.write_bytes(cut.read_bytes()[:1000])
    assert not (tmp_path / "made").exists()
