"""Recordings as videos or numbered images beside a calibration."""

import shutil
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import (
    FolderRecording,
    MarkerTrack,
    empty_scene,
    open_recording,
    write_image,
)
from markerless_tracker.datasets.empty_scene import FRAMES, backgrounds_of
from markerless_tracker.datasets.video.images import VIDEO_SUFFIXES
from markerless_tracker.errors import CalibrationError, ConfigError, DatasetError, ImageError
from markerless_tracker.imaging import scale_image
from markerless_tracker.imaging.background.plate import background_plate


def test_sets_carry_index_stamp_and_every_camera(make_recording) -> None:
    folder = make_recording(frames=5, fps=30000 / 1001)
    recording = open_recording(folder)
    sets = list(recording.frames())
    assert (recording.name, recording.fps, recording.frame_count) == ("small", 30000 / 1001, 5)
    assert [s.index for s in sets] == list(range(5))
    assert [s.stamp_ns for s in sets] == [0, 33366667, 66733333, 100100000, 133466667]
    assert all(list(s.images) == ["cam01", "cam02"] for s in sets)
    assert sets[0].images["cam01"].shape == (48, 64, 3) and recording.warnings == ()


def test_names_in_capitals_are_videos_as_well(make_recording) -> None:
    folder = make_recording()
    videos = [file for file in folder.iterdir() if file.suffix in VIDEO_SUFFIXES]
    for video in videos:
        video.rename(video.with_suffix(video.suffix.upper()))
    assert videos and len(list(open_recording(folder).frames())) > 0


def test_start_and_every_select_the_same_images(make_recording) -> None:
    recording = open_recording(make_recording(frames=8))
    whole = list(recording.frames())
    picked = list(recording.frames(start=1, every=3))
    assert [s.index for s in picked] == [1, 4, 7]
    for part in picked:
        assert part.stamp_ns == whole[part.index].stamp_ns
        for name, image in part.images.items():
            np.testing.assert_array_equal(image, whole[part.index].images[name])


def test_scale_holds_for_images_cameras_and_backgrounds(make_recording) -> None:
    folder = make_recording()
    whole, half = open_recording(folder), open_recording(folder, scale=0.5)
    assert half.rig["cam01"].size_px == (32, 24)
    first, small = next(whole.frames()), next(half.frames())
    np.testing.assert_array_equal(
        small.images["cam02"], scale_image(first.images["cam02"], (32, 24))
    )
    assert half.background_frames()["cam01"][0].shape == (24, 32, 3)


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.5, float("nan")])
def test_impossible_scales_are_refused(make_recording, scale: float) -> None:
    with pytest.raises(ConfigError, match="scale"):
        open_recording(make_recording(), scale=scale)


@pytest.mark.parametrize(("start", "every"), [(-1, 1), (0, 0)])
def test_impossible_starts_and_steps_are_refused(make_recording, start: int, every: int) -> None:
    with pytest.raises(ConfigError, match="start"):
        open_recording(make_recording()).frames(start=start, every=every)


def test_starting_after_the_end_is_refused(make_recording) -> None:
    with pytest.raises(DatasetError, match="frame 6.*6 frames"):
        open_recording(make_recording()).frames(start=6)


def test_the_frame_of_a_stamp(make_recording) -> None:
    recording = open_recording(make_recording(fps=60.0))
    assert recording.start_index(16666667) == 1
    assert recording.start_index(33340000) == 2
    with pytest.raises(DatasetError, match=r"5\.0+ s.*0\.083333 s"):
        recording.start_index(5 * 10**9)


def test_closing_the_iterator_ends_the_threads(make_recording) -> None:
    frames = open_recording(make_recording()).frames()
    next(frames)
    frames.close()
    assert not [t for t in threading.enumerate() if t.name.startswith("decode")]


def test_the_shortest_camera_ends_the_recording(make_recording) -> None:
    folder = make_recording(frames=6)
    shutil.copy(make_recording("short", frames=4) / "cam02.mkv", folder / "cam02.mkv")
    recording = open_recording(folder)
    assert recording.frame_count == 4
    assert "cam01 6, cam02 4" in recording.warnings[0]
    assert len(list(recording.frames())) == 4


def test_a_cut_video_ends_the_recording_with_a_warning(make_recording) -> None:
    folder = make_recording(frames=30)
    content = (folder / "cam02.mkv").read_bytes()
    (folder / "cam02.mkv").write_bytes(content[: len(content) // 2])
    recording = open_recording(folder)
    read = list(recording.frames())
    assert 0 < len(read) < 30
    assert any("cam02" in warning for warning in recording.warnings)


def streamed(path: Path) -> None:
    """Makes a Matroska file look as if streamed: its Duration (0x4489) becomes a Void element."""
    content = path.read_bytes()
    place = content.index(b"\x44\x89\x88")
    path.write_bytes(content[:place] + b"\xec\x89" + bytes(9) + content[place + 11 :])


def test_a_video_without_a_frame_count_is_read_to_its_end(make_recording) -> None:
    folder = make_recording(frames=5)
    whole = list(open_recording(folder).frames())
    for name in ("cam01", "cam02"):
        streamed(folder / f"{name}.mkv")
    recording = open_recording(folder)
    assert recording.frame_count is None
    read = list(recording.frames())
    assert [s.stamp_ns for s in read] == [s.stamp_ns for s in whole]
    np.testing.assert_array_equal(read[-1].images["cam02"], whole[-1].images["cam02"])
    assert recording.start_index(66_666_667) == 4 and recording.warnings == ()
    assert [s.index for s in recording.frames(start=1, every=3)] == [1, 4]
    with pytest.raises(DatasetError, match=r"cam01, cam02 has no frame 5"):
        next(recording.frames(start=5))


def test_a_camera_without_a_frame_count_that_ends_first_is_named(make_recording) -> None:
    folder = make_recording(frames=6)
    shutil.copy(make_recording("short", frames=4) / "cam02.mkv", folder / "cam02.mkv")
    streamed(folder / "cam02.mkv")
    recording = open_recording(folder)
    assert recording.frame_count is None and len(list(recording.frames())) == 4
    assert "cam02 cannot be read beyond frame 3 of 6" in recording.warnings[0]
    streamed(folder / "cam01.mkv")
    recording = open_recording(folder)
    assert len(list(recording.frames())) == 4
    assert "cam02 ends after frame 3, before the other cameras" in recording.warnings[0]


def test_learning_keeps_few_images_of_a_recording_of_unknown_length(
    make_recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_recording(frames=2 * FRAMES + 7, backgrounds=0)
    for name in ("cam01", "cam02"):
        streamed(folder / f"{name}.mkv")
    recording = open_recording(folder)
    whole = [frame.images["cam01"] for frame in recording.frames()]
    used = {}

    def plate(clips, stills, *, camera):
        used[camera] = clips[0]
        return background_plate(clips, stills, camera=camera)

    monkeypatch.setattr(empty_scene, "background_plate", plate)
    assert list(backgrounds_of(recording)) == ["cam01", "cam02"]
    # Every second image of the whole recording.
    np.testing.assert_array_equal(used["cam01"], whole[::2])


@pytest.mark.parametrize("content", [b"", b"this is no video at all" * 50])
def test_unreadable_videos_are_named(make_recording, content: bytes) -> None:
    folder = make_recording()
    (folder / "cam02.mkv").write_bytes(content)
    with pytest.raises(DatasetError, match="cam02.mkv"):
        open_recording(folder)


def test_a_missing_camera_is_named(make_recording) -> None:
    folder = make_recording()
    (folder / "cam02.mkv").unlink()
    with pytest.raises(DatasetError, match="no images of cam02.*cam02.mp4"):
        open_recording(folder)


def test_a_size_other_than_the_calibration_is_named(make_recording) -> None:
    folder = make_recording()
    text = (folder / "calibration.toml").read_text()
    (folder / "calibration.toml").write_text(text.replace("[64, 48]", "[66, 48]", 1))
    with pytest.raises(ImageError, match="cam01.*64x48.*66x48"):
        open_recording(folder)


def test_a_malformed_calibration_is_named(make_recording) -> None:
    folder = make_recording()
    (folder / "calibration.toml").write_text("[cam01")
    with pytest.raises(CalibrationError, match="calibration.toml"):
        open_recording(folder)


def test_rates_must_agree(make_recording) -> None:
    folder = make_recording(fps=60.0)
    shutil.copy(make_recording("slow", fps=30.0) / "cam02.mkv", folder / "cam02.mkv")
    with pytest.raises(DatasetError, match="cam01 60, cam02 30"):
        open_recording(folder)
    assert open_recording(folder, input_fps=50.0).fps == 50.0


def as_images(folder: Path, *, grey: bool = False) -> list[dict[str, np.ndarray]]:
    """Turns the videos of a recording into numbered images; returns the images."""
    sets = [dict(s.images) for s in open_recording(folder).frames()]
    for name in sets[0]:
        (folder / f"{name}.mkv").unlink()
        for index, images in enumerate(sets):
            if grey:
                images[name] = cv2.cvtColor(images[name], cv2.COLOR_BGR2GRAY)
            # 8, 9, 10, 11: numbers of different lengths must not sort as text.
            write_image(folder / name / f"img{index + 8}.png", images[name])
    return sets


@pytest.mark.parametrize("grey", [False, True])
def test_numbered_images(make_recording, grey: bool) -> None:
    folder = make_recording(frames=4)
    sets = as_images(folder, grey=grey)
    with pytest.raises(DatasetError, match="cam01.*--input-fps"):
        open_recording(folder)
    recording = open_recording(folder, input_fps=50.0)
    for expected, read in zip(sets, recording.frames(), strict=True):
        for name, image in expected.items():
            np.testing.assert_array_equal(read.images[name], image)
    assert recording.start_index(40_000_000) == 2
    with pytest.raises(ConfigError, match="input fps"):
        open_recording(folder, input_fps=0.0)


def test_numbered_images_of_another_size_or_damaged_are_named(make_recording) -> None:
    folder = make_recording(frames=4)
    as_images(folder)
    write_image(folder / "cam02" / "img10.png", np.zeros((20, 20, 3), np.uint8))
    with pytest.raises(ImageError, match="cam02.*20x20.*64x48"):
        list(open_recording(folder, input_fps=50.0).frames())
    (folder / "cam02" / "img10.png").write_bytes(b"no png")
    with pytest.raises(DatasetError, match="img10.png"):
        list(open_recording(folder, input_fps=50.0).frames())


def test_an_empty_image_folder_is_no_camera(make_recording) -> None:
    folder = make_recording()
    (folder / "cam01.mkv").unlink()
    (folder / "cam01").mkdir()
    with pytest.raises(DatasetError, match="no images of cam01"):
        open_recording(folder)


def test_truth_and_masks(make_recording) -> None:
    folder = make_recording()
    recording = open_recording(folder)
    assert isinstance(recording, FolderRecording)
    assert recording.ground_truth() is None and recording.masks("cam01") == {}
    mask = np.zeros((48, 64), np.uint8)
    mask[10:20, 10:30] = 255
    write_image(folder / "masks" / "cam01" / "000003.png", mask)
    half = open_recording(folder, scale=0.5)
    assert isinstance(half, FolderRecording)
    masks = half.masks("cam01")
    assert list(masks) == [3] and np.count_nonzero(masks[3]) == 50
    write_image(folder / "masks" / "cam01" / "first.png", mask)
    with pytest.raises(DatasetError, match="first.png"):
        half.masks("cam01")


def test_shared_recording(render_walk: Path) -> None:
    recording = open_recording(render_walk)
    assert isinstance(recording, FolderRecording)
    assert (recording.fps, recording.frame_count) == (60.0, 220)
    assert recording.rig.names == read_calibration(render_walk / "calibration.toml").names
    assert [len(v) for v in recording.background_frames().values()] == [30] * 4
    assert sorted(recording.masks("cam01")) == [0, 50, 100, 150, 200]
    truth = recording.ground_truth()
    assert isinstance(truth, MarkerTrack)
    assert [recording.start_index(int(stamp)) for stamp in truth.stamps_ns[:3]] == [0, 1, 2]
