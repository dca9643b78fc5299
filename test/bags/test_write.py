"""Round trips of recordings through bags, and failures that must leave no bag."""

import json
import tracemalloc
import weakref
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from markerless_tracker.bags import write_bag
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import FrameSet, MarkerTrack, Recording, open_recording, write_trc
from markerless_tracker.datasets.part import PartRecording
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.geometry import inverse, rotation_from_quaternion, transform


def assert_same(read: Recording, source: Recording, *, every: int = 1) -> None:
    assert read.rig.names == source.rig.names and read.fps == pytest.approx(source.fps / every)
    for a, b in zip(read.rig, source.rig, strict=True):
        assert a.size_px == b.size_px
        for field in ("matrix", "distortion", "T_cam_world"):
            np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
    for got, sent in zip(read.frames(), source.frames(every=every), strict=True):
        assert got.stamp_ns == sent.stamp_ns
        for name in source.rig.names:
            np.testing.assert_array_equal(got.images[name], sent.images[name])
    backgrounds, expected = read.background_frames(), source.background_frames()
    assert list(backgrounds) == list(expected)
    for name, images in expected.items():
        assert len(images) == len(backgrounds[name])
        for a, b in zip(backgrounds[name], images, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("compress", ["none", "zstd", "png"])
@pytest.mark.parametrize(("scale", "every", "backgrounds"), [(1.0, 1, 1), (0.5, 3, 3)])
def test_a_bag_holds_the_same_bytes(
    make_recording, tmp_path: Path, compress: str, scale: float, every: int, backgrounds: int
) -> None:
    source = open_recording(make_recording(frames=7, backgrounds=backgrounds), scale=scale)
    seen = []
    summary = write_bag(
        source,
        tmp_path / "out",
        every=every,
        compress=compress,
        progress=lambda done, total: seen.append((done, total)),
    )
    sets = -(-7 // every)
    assert (summary.sets, summary.first_ns) == (sets, 0)
    assert seen == [(i + 1, sets) for i in range(sets)]
    bag = open_recording(tmp_path / "out")
    assert bag.frame_count == sets and bag.warnings == ()
    assert_same(bag, source, every=every)
    assert_same(open_recording(tmp_path / "out" / "out.mcap"), source, every=every)


def test_scaling_before_or_after_the_bag_is_the_same(make_recording, tmp_path: Path) -> None:
    folder = make_recording()
    write_bag(open_recording(folder), tmp_path / "full")
    assert_same(open_recording(tmp_path / "full", scale=0.5), open_recording(folder, scale=0.5))


def test_a_bag_of_a_bag(make_recording, tmp_path: Path) -> None:
    source = open_recording(make_recording())
    write_bag(source, tmp_path / "one")
    write_bag(open_recording(tmp_path / "one"), tmp_path / "two", compress="zstd")
    assert_same(open_recording(tmp_path / "two"), source)


@pytest.mark.parametrize("part", [False, True])
def test_reference_markers_move_with_the_world(make_recording, tmp_path: Path, part: bool) -> None:
    folder = make_recording()
    points = np.arange(90.0).reshape(2, 15, 3)
    stored = MarkerTrack(MARKER_NAMES, np.array([0, 16_666_667]), points)
    write_trc(folder / "ground_truth.trc", stored, 60.0)
    still, moved = open_recording(folder), open_recording(folder)
    moved.move(transform(np.eye(3), [0.0, 0.0, 5.0]))
    for recording, name in ((still, "still"), (moved, "moved")):
        write_bag(PartRecording(recording) if part else recording, tmp_path / name)
    copied = tmp_path / "still" / "ground_truth.trc"
    assert copied.read_bytes() == (folder / "ground_truth.trc").read_bytes()
    bag = open_recording(tmp_path / "moved")
    truth = bag.ground_truth()
    assert truth is not None and truth.names == MARKER_NAMES
    np.testing.assert_array_equal(truth.positions_m, points + [0.0, 0.0, 5.0])
    np.testing.assert_array_equal(truth.stamps_ns, stored.stamps_ns)
    np.testing.assert_array_equal(bag.rig["cam01"].T_cam_world, moved.rig["cam01"].T_cam_world)


def test_jpeg_is_close_and_its_background_exact(make_recording, tmp_path: Path) -> None:
    source = open_recording(make_recording())
    smooth = {n: np.full((48, 64, 3), 100, np.uint8) for n in source.rig.names}
    source._read = lambda start, every: iter([FrameSet(0, 0, smooth)])  # type: ignore[method-assign]
    write_bag(source, tmp_path / "out", compress="jpeg")
    bag = open_recording(tmp_path / "out")
    image = next(bag.frames()).images["cam01"]
    assert np.abs(image.astype(int) - 100).max() <= 2
    expected = source.background_frames()["cam02"][0]
    np.testing.assert_array_equal(bag.background_frames()["cam02"][0], expected)
    assert "one set only" in bag.warnings[0]


def test_other_readers_read_the_same_messages(make_recording, tmp_path: Path) -> None:
    source = open_recording(make_recording(frames=3))
    write_bag(source, tmp_path / "out")
    camera = source.rig["cam02"]
    with AnyReader([tmp_path / "out"], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
        counts = {c.topic: c.msgcount for c in bag.connections}
        messages = {c.topic: bag.deserialize(data, c.msgtype) for c, _, data in bag.messages()}
    assert counts == {
        "/tf_static": 1,
        "/cam01/image_raw": 3,
        "/cam02/image_raw": 3,
        "/cam01/camera_info": 3,
        "/cam02/camera_info": 3,
    }
    info, image = messages["/cam02/camera_info"], messages["/cam02/image_raw"]
    assert info.header.frame_id == image.header.frame_id == "cam02_optical_frame"
    assert (info.header.stamp.sec, info.header.stamp.nanosec) == (0, 33333333)
    assert (image.encoding, image.step, image.height) == ("bgr8", 192, 48)
    assert info.distortion_model == "plumb_bob"
    np.testing.assert_array_equal(info.k.reshape(3, 3), camera.matrix)
    np.testing.assert_array_equal(info.d, camera.distortion)
    np.testing.assert_array_equal(info.p.reshape(3, 4)[:, :3], camera.matrix)
    np.testing.assert_array_equal(info.r.reshape(3, 3), np.eye(3))
    static = {t.child_frame_id: t for t in messages["/tf_static"].transforms}["cam02_optical_frame"]
    q, t = static.transform.rotation, static.transform.translation
    pose = transform(rotation_from_quaternion([q.w, q.x, q.y, q.z]), [t.x, t.y, t.z])
    assert static.header.frame_id == "map"
    np.testing.assert_allclose(inverse(pose), camera.T_cam_world, atol=1e-12)
    with (tmp_path / "out" / "out.mcap").open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count == 13
    about = yaml.safe_load((tmp_path / "out" / "metadata.yaml").read_text())
    assert about["rosbag2_bagfile_information"]["version"] == 9
    assert "transient_local" in json.dumps(about) and "keep_last" in json.dumps(about)


def test_given_backgrounds_replace_the_recordings(make_recording, tmp_path: Path) -> None:
    given = np.full((48, 64, 3), 7, np.uint8)
    write_bag(open_recording(make_recording()), tmp_path / "out", backgrounds={"cam01": [given]})
    found = open_recording(tmp_path / "out").background_frames()
    assert list(found) == ["cam01"]
    np.testing.assert_array_equal(found["cam01"][0], given)
    assert cv2.imread(str(tmp_path / "out" / "background" / "cam01.png")).max() == 7


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_interruption_leaves_no_bag(make_recording, tmp_path: Path, error) -> None:
    folder = make_recording()
    before = sorted(tmp_path.iterdir())

    def stop(done: int, total: int | None) -> None:
        if done == 3:
            raise error

    with pytest.raises(error):
        write_bag(open_recording(folder), tmp_path / "out", progress=stop)
    assert sorted(tmp_path.iterdir()) == before


def test_existing_targets_and_unknown_compressions_are_refused(
    make_recording, tmp_path: Path
) -> None:
    source = open_recording(make_recording())
    with pytest.raises(DatasetError, match="exists and is not empty"):
        write_bag(source, tmp_path / "small")
    with pytest.raises(ConfigError, match="'bzip'.*none, zstd, png, jpeg"):
        write_bag(source, tmp_path / "out", compress="bzip")
    (tmp_path / "out").mkdir()
    assert write_bag(source, tmp_path / "out").sets == 6


def test_names_that_cannot_be_topics_are_refused(make_recording, tmp_path: Path) -> None:
    folder = make_recording()
    text = (folder / "calibration.toml").read_text().replace("cam01", "cam-01")
    (folder / "calibration.toml").write_text(text)
    (folder / "cam01.mkv").rename(folder / "cam-01.mkv")
    with pytest.raises(DatasetError, match="cam-01"):
        write_bag(open_recording(folder), tmp_path / "out")


def test_stamps_beyond_a_ros_message_are_refused(make_recording, tmp_path: Path) -> None:
    source = open_recording(make_recording())
    images = next(source.frames()).images
    source._read = lambda start, every: iter([FrameSet(0, -5, images)])  # type: ignore[method-assign]
    with pytest.raises(DatasetError, match="stamp -5"):
        write_bag(source, tmp_path / "out")
    source._read = lambda start, every: iter([])  # type: ignore[method-assign]
    with pytest.raises(DatasetError, match="has no set of images"):
        write_bag(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()


class Endless(Recording):
    """A recording of noise that is made when it is read."""

    def __init__(self, like: Recording, sets: int) -> None:
        super().__init__(like.path, like.rig, scale=1.0, fps=60.0, frame_count=sets)
        self.images: list[weakref.ref[np.ndarray]] = []
        self.most = 0

    def ground_truth(self) -> None:
        return None

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        rng = np.random.default_rng(5)
        assert self.frame_count is not None
        for index in range(start, self.frame_count, every):
            images = {}
            for camera in self.rig:
                width, height = camera.size_px
                images[camera.name] = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
                self.images.append(weakref.ref(images[camera.name]))
            self.images = [image for image in self.images if image() is not None]
            self.most = max(self.most, len(self.images))
            yield FrameSet(index, round(index * 1e9 / 60.0), images)

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        raise NotImplementedError


@pytest.mark.parametrize("compress", ["none", "zstd", "png"])
def test_memory_does_not_grow_with_the_length(
    make_recording, tmp_path: Path, compress: str
) -> None:
    like = open_recording(make_recording(size_px=(320, 240)))
    kept = []
    for sets in (20, 120):
        recording = Endless(like, sets)
        tracemalloc.start()
        write_bag(recording, tmp_path / f"bag{sets}", compress=compress)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert recording.most <= 12
        kept.append(peak)
    image = 320 * 240 * 3
    assert kept[0] < 40 * image and kept[1] < kept[0] + 4 * image
