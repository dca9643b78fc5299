"""Writing of bag folders in the layout of rosbag2 (Jazzy): one MCAP file and its metadata.yaml."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml

from markerless_tracker.bags.messages import definition, serialized, typestore
from markerless_tracker.bags.pieces import Piece, PieceWriter
from markerless_tracker.errors import DatasetError

LAST_SECOND = 2**31 - 1
"""Stamps of ROS have int32 seconds; later ones cannot be written."""
CHUNK_BYTES = 768 * 1024
"""Least size of a chunk, the default of rosbag2; a killed writer loses one chunk at most."""

_VERSION = 9
_DISTRIBUTION = "jazzy"
# The value of rclcpp for an unlimited duration.
_FOREVER = {"sec": 9223372036, "nsec": 854775807}


def check_stamp(stamp_ns: int, where: str) -> None:
    """Check that a stamp fits in a ROS message.

    Raises:
        DatasetError: it does not; names what it is of.
    """
    if not 0 <= stamp_ns < (LAST_SECOND + 1) * 10**9:
        raise DatasetError(f"{where}: stamp {stamp_ns} ns cannot be written to a ROS message")


@dataclass(frozen=True)
class Topic:
    """A topic of a bag that is being written.

    Attributes:
        name: absolute name.
        kind: message type, such as sensor_msgs/msg/Image.
        number: id of its channel.
        latched: whether late subscribers receive its last message.
        digest: RIHS01 hash of its type.
    """

    name: str
    kind: str
    number: int
    latched: bool
    digest: str


class BagWriter:
    """A new bag in a folder that exists: `NAME.mcap` for a folder NAME, and `metadata.yaml`.

    Chunks and the summary have checksums. The metadata is written when the block ends without an
    exception; without it, the messages of complete chunks can be read.

    Args:
        folder: of the bag.
        zstd: whether chunks are compressed.
        chunk_bytes: least size of a chunk.
    """

    def __init__(self, folder: Path, *, zstd: bool = False, chunk_bytes: int = CHUNK_BYTES) -> None:
        self._folder = folder
        self._path = folder / f"{folder.resolve().name}.mcap"
        self._file = self._path.open("xb")
        self._mcap = PieceWriter(self._file, zstd=zstd, chunk_bytes=chunk_bytes)
        self._mcap.start("ros2", "markerless_tracker")
        self._schemas: dict[str, int] = {}
        self._topics: list[Topic] = []
        self._counts: Counter[int] = Counter()
        self._first_ns: int | None = None
        self._last_ns = 0

    def topic(self, name: str, kind: str, *, latched: bool = False) -> Topic:
        """Declare a topic of a message type."""
        if kind not in self._schemas:
            text = definition(kind).encode()
            self._schemas[kind] = self._mcap.register_schema(kind, "ros2msg", text)
        digest = typestore().hash_rihs01(kind)
        about = {
            "offered_qos_profiles": _dump([_qos(latched)]).rstrip("\n"),
            "topic_type_hash": digest,
        }
        number = self._mcap.register_channel(name, "cdr", self._schemas[kind], about)
        self._topics.append(Topic(name, kind, number, latched, digest))
        return self._topics[-1]

    def write(self, topic: Topic, stamp_ns: int, message: Any) -> None:
        """Write a message (of rosbags' types) with the time at which it was received.

        Its data must not change before the chunk ends.

        Raises:
            DatasetError: the stamp does not fit in a message, or the file cannot be written.
        """
        self._write(topic, stamp_ns, serialized(message, topic.kind))

    def write_serialized(self, topic: Topic, stamp_ns: int, data: Piece) -> None:
        """Write a message that is serialised already; as `write`."""
        self._write(topic, stamp_ns, (data,))

    def _write(self, topic: Topic, stamp_ns: int, pieces: Sequence[Piece]) -> None:
        check_stamp(stamp_ns, topic.name)
        number = self._counts[topic.number]
        with self._writing():
            self._mcap.add_message(topic.number, stamp_ns, pieces, stamp_ns, number)
        self._counts[topic.number] += 1
        self._first_ns = stamp_ns if self._first_ns is None else min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)

    @property
    def messages(self) -> int:
        """Number of messages written."""
        return self._counts.total()

    def flush(self) -> None:
        """End the current chunk and flush all data to the operating system.

        Raises:
            DatasetError: they cannot be written.
        """
        with self._writing():
            self._mcap.flush()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Raise the system's errors as one that names the file."""
        try:
            yield
        except OSError as error:
            raise DatasetError(f"{self._path}: cannot be written: {error.strerror}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            # The first error is more informative than one of closing the file.
            with suppress(OSError):
                self._file.close()
            return
        with self._writing():
            with self._file:
                about = self._metadata()
                serialized_about = {"serialized_metadata": _dump(about).rstrip("\n")}
                self._mcap.add_metadata("rosbag2", serialized_about)
                self._mcap.finish()
            text = _dump({"rosbag2_bagfile_information": about})
            (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")

    def _metadata(self) -> dict[str, Any]:
        start = {"nanoseconds_since_epoch": self._first_ns or 0}
        duration = {"nanoseconds": self._last_ns - (self._first_ns or 0)}
        return {
            "version": _VERSION,
            "storage_identifier": "mcap",
            "duration": duration,
            "starting_time": start,
            "message_count": self.messages,
            "topics_with_message_count": [
                {
                    "topic_metadata": {
                        "name": topic.name,
                        "type": topic.kind,
                        "serialization_format": "cdr",
                        "offered_qos_profiles": [_qos(topic.latched)],
                        "type_description_hash": topic.digest,
                    },
                    "message_count": self._counts[topic.number],
                }
                for topic in self._topics
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._path.name],
            "files": [
                {
                    "path": self._path.name,
                    "starting_time": start,
                    "duration": duration,
                    "message_count": self.messages,
                }
            ],
            "custom_data": None,
            "ros_distro": _DISTRIBUTION,
        }


def _qos(latched: bool) -> Mapping[str, Any]:
    """QoS: reliable; a latched topic keeps its last message for late subscribers."""
    return {
        "history": "keep_last",
        "depth": 1 if latched else 10,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }


class _Plain(yaml.SafeDumper):
    """YAML without references, which are hard to read for people."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _dump(content: Any) -> str:
    return yaml.dump(content, Dumper=_Plain, sort_keys=False, default_flow_style=False)
