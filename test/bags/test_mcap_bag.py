"""Bags as other tools see them: mcap with its checks, mcap-ros2-support, rosbag2."""

import re
import resource
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from markerless_tracker.bags import write_bag
from markerless_tracker.bags.mcap_bag import BagWriter
from markerless_tracker.bags.messages import message_type
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.datasets.bag.stream import McapFiles
from markerless_tracker.errors import DatasetError


def decoded(path: Path) -> dict[str, list]:
    """Topic -> messages, decoded from the definitions in the file alone."""
    found: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((record.log_time, message))
    return found


def test_a_bag_is_decoded_by_its_own_definitions(walk, tmp_path: Path) -> None:
    recording = open_recording(walk)
    write_bag(recording, tmp_path / "bag")
    topics = decoded(tmp_path / "bag" / "bag.mcap")
    names = recording.rig.names
    assert set(topics) == {
        "/tf_static",
        "/ground_truth/marker_poses",
        *(f"/{name}/{what}" for name in names for what in ("image_raw", "camera_info")),
    }
    (_, static), = topics["/tf_static"]  # fmt: skip
    assert [t.child_frame_id for t in static.transforms] == [f"{n}_optical_frame" for n in names]
    sent = next(recording.frames()).images["cam01"]
    _, image = topics["/cam01/image_raw"][0]
    assert bytes(image.data) == sent.tobytes() and image.encoding == "bgr8"
    _, info = topics["/cam01/camera_info"][0]
    np.testing.assert_array_equal(np.reshape(info.k, (3, 3)), recording.rig["cam01"].matrix)
    # The reference markers: the 15 in order, with the stamps of the sets.
    truth = read_trc(walk / "ground_truth.trc")
    poses = topics["/ground_truth/marker_poses"]
    stamps = [frame.stamp_ns for frame in recording.frames()]
    assert [stamp for stamp, _ in poses] == stamps
    for row, (stamp, message) in enumerate(poses):
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        found = [[p.position.x, p.position.y, p.position.z] for p in message.poses]
        np.testing.assert_allclose(found, truth.positions_m[row], atol=1e-9)
    np.testing.assert_array_equal(
        read_trc(tmp_path / "bag" / "ground_truth.trc").positions_m, truth.positions_m
    )


def test_checksums_are_written_and_found_wrong(make_recording, tmp_path: Path) -> None:
    write_bag(open_recording(make_recording()), tmp_path / "bag")
    file = tmp_path / "bag" / "bag.mcap"
    with file.open("rb") as stream:
        for chunk in (r for r in StreamReader(stream, emit_chunks=True).records):
            assert getattr(chunk, "uncompressed_crc", 1) != 0
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    recording = open_recording(tmp_path / "bag")
    assert len(list(recording.frames())) < 6
    assert sum("cut or damaged" in warning for warning in recording.warnings) == 1


def test_metadata_is_that_of_rosbag2(make_recording, tmp_path: Path) -> None:
    write_bag(open_recording(make_recording(frames=3)), tmp_path / "bag")
    text = (tmp_path / "bag" / "metadata.yaml").read_text(encoding="utf-8")
    about = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert list(about) == [
        "version", "storage_identifier", "duration", "starting_time", "message_count",
        "topics_with_message_count", "compression_format", "compression_mode",
        "relative_file_paths", "files", "custom_data", "ros_distro",
    ]  # fmt: skip
    assert (about["version"], about["ros_distro"], about["message_count"]) == (9, "jazzy", 13)
    topics = {t["topic_metadata"]["name"]: t for t in about["topics_with_message_count"]}
    static = topics["/tf_static"]["topic_metadata"]
    assert static["offered_qos_profiles"][0]["durability"] == "transient_local"
    assert topics["/cam01/image_raw"]["message_count"] == 3
    # As `ros2 topic info --verbose` states it on Jazzy.
    assert topics["/cam01/image_raw"]["topic_metadata"]["type_description_hash"] == (
        "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
    )
    assert not re.search(r"[&*]id\d", text)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        (record,) = make_reader(file).iter_metadata()
    assert record.name == "rosbag2"
    assert yaml.safe_load(record.metadata["serialized_metadata"]) == about


def test_a_bag_in_the_working_folder_has_its_name(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with BagWriter(Path(".")):
        pass
    assert (tmp_path / f"{tmp_path.name}.mcap").is_file()


def test_latched_topics_are_known_to_be_so(tmp_path: Path) -> None:
    text = message_type("std_msgs/msg/String")(data="hello")
    with BagWriter(tmp_path) as writer:
        for name, latched in (("/state", True), ("/chatter", False)):
            writer.write(writer.topic(name, "std_msgs/msg/String", latched=latched), 5, text)
    assert McapFiles([tmp_path / f"{tmp_path.name}.mcap"]).latched == {"/state"}


def test_a_writer_that_fails_leaves_readable_chunks(tmp_path: Path) -> None:
    text = message_type("std_msgs/msg/String")(data="hello")
    with pytest.raises(KeyError), BagWriter(tmp_path) as writer:
        topic = writer.topic("/chatter", "std_msgs/msg/String")
        writer.write(topic, 5, text)
        writer.flush()
        raise KeyError
    assert not (tmp_path / "metadata.yaml").exists()
    with next(tmp_path.glob("*.mcap")).open("rb") as file:
        assert any(getattr(r, "channel_id", None) for r in _until_cut(file))
    (tmp_path / "late").mkdir()
    with pytest.raises(DatasetError, match="/chatter: stamp -1"):
        with BagWriter(tmp_path / "late") as writer:
            writer.write(writer.topic("/chatter", "std_msgs/msg/String"), -1, text)


def test_a_full_disk_is_told_with_the_file(tmp_path: Path) -> None:
    text = message_type("std_msgs/msg/String")(data="x" * 5000)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
    named = rf"{tmp_path.name}.mcap: cannot be written: File too large"
    try:
        with pytest.raises(DatasetError, match=named), BagWriter(tmp_path) as writer:
            topic = writer.topic("/chatter", "std_msgs/msg/String")
            for stamp_ns in range(10):
                writer.write(topic, stamp_ns, text)
                writer.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    # What came before can be read.
    with next(tmp_path.glob("*.mcap")).open("rb") as file:
        assert any(getattr(r, "channel_id", None) for r in _until_cut(file))


def _until_cut(file):
    try:
        yield from StreamReader(file).records
    except Exception:
        return
