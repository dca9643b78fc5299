"""Messages of MCAP files in file order, as far as they are whole."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from markerless_tracker.errors import DatasetError

MAGIC = b"\x89MCAP0\r\n"


class RawMessage(NamedTuple):
    """One message as stored."""

    topic: str
    type: str
    data: bytes


class McapFiles:
    """The messages of one or more MCAP files, one after the other.

    Attributes:
        paths: the files.
        counts: topic -> number of messages, None for a damaged bag (only reading tells).
        types: topic -> message type, of a whole bag; filled while reading a damaged one.
        damage: where and why reading stopped early, None so far.

    Raises:
        DatasetError: a file is missing, unreadable or no MCAP at all.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        self.types: dict[str, str] = {}
        self.damage: str | None = None
        self.counts: dict[str, int] | None = {}
        for path in self.paths:
            try:
                with path.open("rb") as file:
                    start = file.read(len(MAGIC))
            except OSError as error:
                raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
            if start != MAGIC:
                raise DatasetError(f"{path}: not an MCAP file (it starts with {start!r})")
            if self.counts is not None and not self._read_summary(path):
                self.counts = None

    def _read_summary(self, path: Path) -> bool:
        try:
            with path.open("rb") as file:
                summary = make_reader(file).get_summary()
        except Exception:  # hostile bytes raise whatever they like; the stream reader copes
            return False
        if summary is None or summary.statistics is None or self.counts is None:
            return False
        for number, channel in summary.channels.items():
            schema = summary.schemas.get(channel.schema_id)
            self.types[channel.topic] = schema.name if schema else ""
            count = summary.statistics.channel_message_counts.get(number, 0)
            self.counts[channel.topic] = self.counts.get(channel.topic, 0) + count
        return True

    def __iter__(self) -> Iterator[RawMessage]:
        """Every message before the first damage of each file."""
        for path in self.paths:
            yield from self._messages(path)

    def _messages(self, path: Path) -> Iterator[RawMessage]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with path.open("rb") as file:
            # No record is longer than its file: a damaged length must not ask for gigabytes.
            limit = path.stat().st_size
            records = iter(StreamReader(file, record_size_limit=limit).records)
            while True:
                try:
                    record = next(records, None)
                except Exception as error:  # hostile bytes raise whatever they like
                    self.damage = (
                        f"{path}: cut or damaged, read up to there ({type(error).__name__})"
                    )
                    return
                if record is None:
                    return
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                    schema = schemas.get(record.schema_id)
                    self.types[record.topic] = schema.name if schema else ""
                elif isinstance(record, Message) and record.channel_id in channels:
                    topic = channels[record.channel_id].topic
                    yield RawMessage(topic, self.types[topic], record.data)
