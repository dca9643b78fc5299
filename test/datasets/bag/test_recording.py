"""Bags of other tools, and bags that are cut, damaged or incomplete."""

import io
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import open_recording
from markerless_tracker.errors import CalibrationError, DatasetError, ImageError, TrackerError

from .conftest import (
    COMPRESSED,
    FRAME,
    IMAGE,
    STEP_NS,
    STORE,
    both,
    frames_message,
    header,
    image,
    info,
    make,
    save,
    static,
)


def test_sets_are_grouped_by_header_stamp_not_by_order(bag) -> None:
    pairs = [both(10**18 + i * STEP_NS) for i in range(4)]
    mixed = [pairs[0][0], pairs[1][0], pairs[0][1], pairs[1][1], *pairs[2][::-1], *pairs[3]]
    recording = open_recording(bag(mixed))
    assert [s.stamp_ns - 10**18 for s in recording.frames()] == [i * STEP_NS for i in range(4)]
    assert recording.fps == 20.0 and recording.warnings == ()
    assert recording.start_index(10**18 + 2 * STEP_NS + 1000) == 2
    with pytest.raises(DatasetError, match="no frame within half a frame"):
        recording.start_index(0)
    assert [s.index for s in recording.frames(start=1, every=2)] == [1, 3]


def test_numbered_parts_are_read_in_the_order_of_their_numbers(bag, tmp_path: Path) -> None:
    """As a killed recorder leaves them, without metadata.yaml."""
    parts = tmp_path / "parts"
    parts.mkdir()
    for number in range(12):
        part = bag([*both(2 * number * STEP_NS), *both((2 * number + 1) * STEP_NS)])
        shutil.copy(next(part.glob("*.mcap")), parts / f"rec_{number}.mcap")
        shutil.copy(part / "calibration.toml", parts)
        shutil.rmtree(part)
    stamps = [frame.stamp_ns for frame in open_recording(parts).frames()]
    assert stamps == [index * STEP_NS for index in range(24)]


def test_topics_without_messages_are_no_images(make_recording, tmp_path: Path) -> None:
    """A recorder keeps a channel of every topic that it subscribed to."""
    path = tmp_path / "silent"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name in ("cam01", "cam03"):
            writer.add_connection(f"/{name}/image_raw", IMAGE, typestore=STORE)
        for name in ("cam01", "cam02"):
            topic = f"/{name}/image_raw/compressed"
            connection = writer.add_connection(topic, COMPRESSED, typestore=STORE)
            for stamp_ns in (0, STEP_NS):
                data = cv2.imencode(".png", FRAME)[1].reshape(-1)
                message = make(COMPRESSED, header=header(stamp_ns), format="png", data=data)
                writer.write(connection, stamp_ns, STORE.serialize_cdr(message, COMPRESSED))
    shutil.copy(make_recording() / "calibration.toml", path)
    recording = open_recording(path)
    assert set(recording._namespaces) == {"cam01", "cam02"}
    frames = list(recording.frames())
    assert len(frames) == 2
    np.testing.assert_array_equal(frames[1].images["cam01"], FRAME)


def test_a_bag_without_an_index_of_messages_is_read_forward(bag) -> None:
    """Which the format allows: rosbag2 writes it with `noMessageIndex`."""
    path = bag([m for index in range(3) for m in both(index * STEP_NS)])
    (file,) = path.glob("*.mcap")
    whole = file.read_bytes()
    kinds = IndexType.ATTACHMENT | IndexType.CHUNK | IndexType.METADATA
    with file.open("wb") as out:
        writer = McapWriter(out, index_types=kinds)
        writer.start("ros2")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(io.BytesIO(whole)).iter_messages():
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time
            )
        writer.finish()
    assert [frame.stamp_ns for frame in open_recording(path).frames()] == [0, STEP_NS, 2 * STEP_NS]


def test_incomplete_sets_are_skipped_and_counted(bag) -> None:
    pairs = [both(i * STEP_NS) for i in range(6)]
    messages = [*pairs[0], pairs[1][0], *pairs[2], pairs[3][1], *pairs[4], pairs[5][0]]
    recording = open_recording(bag(messages))
    assert [s.stamp_ns // STEP_NS for s in recording.frames()] == [0, 2, 4]
    assert len(recording.warnings) == 1 and "cam01 1, cam02 2" in recording.warnings[0]


def test_a_camera_without_images_uses_bounded_memory_and_is_an_error(bag) -> None:
    messages = [both(i * STEP_NS)[0] for i in range(50)]
    messages += [both(10**12)[1]]
    with pytest.raises(DatasetError, match="no set of images is complete.*cam01, cam02"):
        open_recording(bag(messages))


def test_images_recorded_late_are_skipped_and_reported(bag) -> None:
    messages = [m for i in (0, 1, 2, 0, 1) for m in both(i * STEP_NS)]
    recording = open_recording(bag(messages))
    assert len(list(recording.frames())) == 3
    assert (
        "recorded after later ones" in recording.warnings[0] and "cam01 2" in recording.warnings[0]
    )


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [("rgb8", FRAME[..., ::-1]), ("bgra8", np.dstack([FRAME, FRAME[..., 0]])), ("bgr8", FRAME)],
)
def test_encodings(bag, encoding: str, pixels: np.ndarray) -> None:
    recording = open_recording(bag(both(0, pixels=pixels, encoding=encoding)))
    np.testing.assert_array_equal(next(recording.frames()).images["cam02"], FRAME)


def test_grey_and_compressed_images(bag) -> None:
    data = cv2.imencode(".png", FRAME)[1].reshape(-1)
    messages = [("/cam01/image_raw", IMAGE, image(0, FRAME[..., 0], "mono8"))]
    png = make(COMPRESSED, header=header(0), format="png", data=data)
    messages += [("/ns/cam02/image_raw/compressed", COMPRESSED, png)]
    images = next(open_recording(bag(messages)).frames()).images
    np.testing.assert_array_equal(images["cam01"], FRAME[..., 0])
    np.testing.assert_array_equal(images["cam02"], FRAME)


def test_images_of_another_size_or_encoding_are_named(bag) -> None:
    recording = open_recording(bag(both(0, pixels=FRAME[:40]), "cut"))
    with pytest.raises(ImageError, match="/cam01/image_raw.*64x40.*64x48"):
        next(recording.frames())
    recording = open_recording(bag(both(0, pixels=FRAME, encoding="mono16"), "deep"))
    with pytest.raises(ImageError, match="/cam01/image_raw.*mono16.*bgr8"):
        next(recording.frames())


def test_missing_topics_are_listed(bag) -> None:
    only = [m for i in range(2) for m in both(i * STEP_NS)[:1]]
    with pytest.raises(
        DatasetError, match="no images of cam02.*/cam02/image_raw.*/cam01/image_raw"
    ):
        open_recording(bag(only))


def test_without_calibration_file_the_rig_is_read_from_topics(
    make_recording, tmp_path: Path
) -> None:
    rig = read_calibration(make_recording() / "calibration.toml")
    # map -> rig (rotated by 90 degrees about z) -> camera.
    chain = frames_message(
        static("map", "rig", (1.0, 2.0, 3.0), (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))),
        static("rig", "cam01_optical_frame", (1.0, 0.0, 0.0)),
        static("map", "cam02_optical_frame", (0.0, 0.0, 1.0)),
    )
    messages = [chain, info("cam01", rig), info("cam02", rig), *both(0), *both(STEP_NS)]
    recording = open_recording(save(tmp_path / "bag", messages))
    assert recording.rig.names == ("cam01", "cam02")
    camera = recording.rig["cam01"]
    np.testing.assert_allclose(camera.T_world_cam[:3, 3], [1.0, 3.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(camera.T_world_cam[:3, 0], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(camera.matrix, rig["cam01"].matrix)
    np.testing.assert_array_equal(camera.distortion, rig["cam01"].distortion)


def test_missing_or_unsupported_calibration_topics_are_named(
    make_recording, tmp_path: Path
) -> None:
    rig = read_calibration(make_recording() / "calibration.toml")
    infos = [info("cam01", rig), info("cam02", rig)]
    one = static("map", "cam01_optical_frame", (0.0, 0.0, 0.0))
    two = static("map", "cam02_optical_frame", (0.0, 0.0, 0.0))
    nothing = static("map", "cam02_optical_frame", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    cases = [
        ([infos[0]], DatasetError, "no calibration of cam02.*cam02/camera_info"),
        ([*infos, frames_message(one)], CalibrationError, "cam02.*no static transform"),
        ([*infos, frames_message(one, nothing)], CalibrationError, "cam02.*non-zero quaternion"),
        (
            [*infos, frames_message(one, static("odom", "cam02_optical_frame", (0.0, 0.0, 0.0)))],
            CalibrationError,
            "cam02 in odom",
        ),
        (
            [*infos, frames_message(one, two, static("cam02_optical_frame", "map", (0.0,) * 3))],
            CalibrationError,
            "cycle",
        ),
        (
            [
                infos[0],
                info("cam02", rig, distortion_model="equidistant"),
                frames_message(one, two),
            ],
            CalibrationError,
            "cam02.*equidistant",
        ),
        (
            [infos[0], info("cam02", rig, binning_x=2), frames_message(one, two)],
            CalibrationError,
            "cam02.*binning",
        ),
        (
            [infos[0], info("cam02", rig, k=np.zeros(9)), frames_message(one, two)],
            CalibrationError,
            "cam02.*K is zero",
        ),
    ]
    for number, (messages, error, reported) in enumerate(cases):
        with pytest.raises(error, match=reported):
            open_recording(save(tmp_path / f"bag{number}", [*messages, *both(0)]))


def test_a_bag_without_images_lists_its_topics(tmp_path: Path) -> None:
    text = make("std_msgs/msg/String", data="hello")
    with pytest.raises(DatasetError, match=r"NAME/image_raw.*/chatter \(std_msgs/msg/String\)"):
        open_recording(save(tmp_path / "bag", [("/chatter", "std_msgs/msg/String", text)]))
    with pytest.raises(DatasetError, match="the bag has no topics"):
        open_recording(save(tmp_path / "empty", []))


def cut(path: Path, share: float) -> None:
    file = next(path.glob("*.mcap"))
    content = file.read_bytes()
    file.write_bytes(content[: int(len(content) * share)])


def test_a_cut_bag_is_read_up_to_the_cut(bag) -> None:
    path = bag([m for i in range(200) for m in both(i * STEP_NS)])
    cut(path, 0.6)
    recording = open_recording(path)
    read = list(recording.frames())
    assert 50 < len(read) < 200 and recording.frame_count == len(read)
    assert [s.stamp_ns for s in read] == [i * STEP_NS for i in range(len(read))]
    assert any("cut or damaged" in warning for warning in recording.warnings)
    # The bag's description may be missing, too: it is written last.
    (path / "metadata.yaml").unlink()
    assert len(list(open_recording(path).frames())) == len(read)


def test_a_bag_cut_before_its_first_set_is_an_error(bag) -> None:
    path = bag([m for i in range(4) for m in both(i * STEP_NS)])
    file = next(path.glob("*.mcap"))
    for size in (0, 5, 40, 400):
        file.write_bytes(file.read_bytes()[:400][:size].ljust(size, b"\0"))
        with pytest.raises(DatasetError, match="not an MCAP|cut or damaged"):
            open_recording(path)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=30))
@example([(0.0024, 1)])
def test_damaged_bytes_raise_only_our_errors(whole_bag, edits) -> None:
    file = next(whole_bag.glob("*.mcap"))
    content = file.read_bytes()
    damaged = bytearray(content)
    for place, value in edits:
        damaged[int(place * (len(damaged) - 1))] = value
    file.write_bytes(damaged)
    try:
        recording = open_recording(whole_bag)
        for start in (0, recording.start_index(STEP_NS)):
            for frame in recording.frames(start=start):
                assert set(frame.images) == {"cam01", "cam02"}
    except TrackerError as error:
        assert "\n" not in str(error)
    finally:
        file.write_bytes(content)


@pytest.fixture
def whole_bag(bag) -> Path:
    tiny = np.zeros((48, 64), np.uint8)
    return bag([m for i in range(3) for m in both(i * STEP_NS, pixels=tiny, encoding="mono8")])


def test_other_files_and_storages_are_refused_by_name(tmp_path: Path, bag) -> None:
    (tmp_path / "x.mcap").write_bytes(b"hello world, not a bag")
    with pytest.raises(DatasetError, match="x.mcap: not an MCAP"):
        open_recording(tmp_path / "x.mcap")
    path = bag(both(0))
    described = (path / "metadata.yaml").read_text()
    for text, reported in (
        ("a: [", "not a rosbag2 description"),
        ("[]", "not a rosbag2 description"),
        ("[" * 5000, "not a rosbag2 description: RecursionError: maximum recursion depth"),
        (described.replace("storage_identifier: mcap", "storage_identifier: sqlite3"), "sqlite3"),
        (described.replace("bag.mcap", "gone.mcap"), "gone.mcap: cannot be read"),
        (described.replace("compression_mode: ''", "compression_mode: FILE"), "compressed by FILE"),
    ):
        assert text != described
        (path / "metadata.yaml").write_text(text)
        with pytest.raises(DatasetError, match=reported) as error:
            open_recording(path)
        assert "\n" not in str(error.value)
    (tmp_path / "void").mkdir()
    with pytest.raises(DatasetError, match="no bag"):
        open_recording(tmp_path / "void", format="bag")
