"""Evidence on topics is that of memory, to the byte; what is none is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

from markerless_tracker.errors import ImageError
from markerless_tracker.node.inputs.wire import (
    EDGES,
    FORMAT,
    SILHOUETTE,
    Evidence,
    edges_data,
    read_evidence,
    settings_digest,
    silhouette_data,
    unpack,
)
from markerless_tracker.node.ros.messages import header
from markerless_tracker.records import Observation
from markerless_tracker.tracking import TrackerConfig

DIGEST = b"8 bytes."
STAMP_NS = 1_700_000_000_123_456_789


def observation(width: int, height: int, *, edges: bool = True, seed: int = 0) -> Observation:
    """Random classes of a region at (3, 5) of a frame."""
    rng = np.random.default_rng(seed)
    classes = rng.integers(0, 3, (height, width))
    map_ = rng.integers(0, 256, (height, width), dtype=np.uint8)
    seen = Observation.from_mask(
        "cam01", STAMP_NS, classes == 1, map_ if edges else np.zeros_like(map_),
        undecided=classes == 2, size_px=(width + 10, height + 7), offset_px=(3, 5),
    )  # fmt: skip
    return replace(seen, exposure=(1.0, 0.9731234567891234, 1.25))


def sent(data: bytes) -> bytes:
    message = CompressedImage(header=header(STAMP_NS, "cam01_optical_frame"), format=FORMAT)
    message.data = list(data)
    return bytes(serialize_message(message))


def parts(seen: Observation) -> tuple[Any, ...]:
    undecided = seen.undecided_words
    return (
        seen.camera, seen.stamp_ns, seen.size_px, seen.offset_px, seen.exposure,
        seen.mask_words.tobytes(), seen.edges.tobytes(), seen.edges.shape,
        None if undecided is None else undecided.tobytes(),
    )  # fmt: skip


@pytest.mark.parametrize("width", [64, 65, 130])
def test_an_observation_arrives_as_it_was(width: int) -> None:
    seen = observation(width, 33)
    first = read_evidence(sent(silhouette_data(seen, DIGEST)), "cam01/silhouette")
    second = read_evidence(sent(edges_data(seen, DIGEST)), "cam01/edges")
    assert (first.kind, second.kind) == (SILHOUETTE, EDGES)
    assert first.digest == DIGEST and first.frame_id == "cam01_optical_frame"
    assert (first.width, first.height) == seen.size_px
    assert parts(unpack("cam01", Evidence(first, second))) == parts(seen)
    without = unpack("cam01", Evidence(first, None))
    assert not without.edges.any()
    assert parts(without) == parts(replace(seen, edges=np.zeros_like(seen.edges)))


def test_nobody_is_two_percent_of_nothing() -> None:
    empty = Observation.from_mask("cam01", 5, np.zeros((490, 656)), np.zeros((490, 656), np.uint8))
    data = silhouette_data(empty, DIGEST)
    assert len(data) < 490 * 656 * 3 / 1000
    assert (
        parts(unpack("cam01", Evidence(read_evidence(sent(data), "t"), None)))[5:]
        == (parts(empty)[5:])
    )


def test_the_digest_is_that_of_the_imaging_alone() -> None:
    def digest(**given: Any) -> bytes:
        return settings_digest(TrackerConfig.from_mapping(given))

    assert digest() == digest(evaluations=77, seed=3) == digest(**{"refine.iterations": 2})
    assert (
        len({digest(), digest(**{"mask.open_px": 5}), digest(**{"shadow.undecided": False})}) == 3
    )


@settings(max_examples=150)
@given(st.data())
def test_damage_is_refused_or_gives_an_observation(data: st.DataObject) -> None:
    good = sent(silhouette_data(observation(70, 9), DIGEST))
    damaged = bytearray(good)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(damaged) - 1))
        damaged[at] = data.draw(st.integers(0, 255))
    cut = bytes(damaged[: data.draw(st.integers(0, len(damaged)))])
    for message in (bytes(damaged), cut):
        try:
            unpack("cam01", Evidence(read_evidence(message, "cam01/silhouette"), None))
        except ImageError as error:
            assert str(error).startswith(("cam01/silhouette: ", "cam01: "))


def test_a_small_message_does_not_unpack_to_a_large_one() -> None:
    import zlib

    seen = observation(70, 9)
    data = silhouette_data(seen, DIGEST)
    head = len(data) - len(zlib.compress(zlib.decompress(data[-_packed(data) :]), 1))
    bomb = data[:head] + zlib.compress(bytes(50_000_000), 9)
    with pytest.raises(ImageError, match=r"t: evidence of 289 bytes or more, expected 288"):
        unpack("cam01", Evidence(read_evidence(sent(bomb), "t"), None))


def _packed(data: bytes) -> int:
    """Length of the compressed part."""
    return len(data) - 4 - 1 - 1 - 8 - 24 - 3 * 8


def test_an_image_is_no_evidence() -> None:
    with pytest.raises(ImageError, match="t: 400 bytes of format .*expected evidence"):
        read_evidence(sent(bytes(400)), "t")
