"""Messages of MCAP files in file order, up to the first damage; seeking by their chunk index."""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, McapRecord, Message, MessageIndex, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary

from markerless_tracker.datasets.bag.cut_chunk import intact_records
from markerless_tracker.datasets.bag.plain_chunk import plain_chunk, records_of
from markerless_tracker.errors import DatasetError

MAGIC = b"\x89MCAP0\r\n"
# Bytes of a serialised message that hold the stamp of its std_msgs/Header.
HEAD_BYTES = 12
# Bytes before the messages of an uncompressed chunk: opcode, length, and the fields of the record.
_CHUNK_HEAD = 1 + 8 + 8 + 8 + 8 + 4 + 4 + 8
_DURABILITY = re.compile(r"durability:\s*(\w+)")
# In words, and as older versions of rosbag2 number it.
_TRANSIENT_LOCAL = ("transient_local", "1")
# Bytes before the data of a message: opcode, length, channel, sequence and two times.
_MESSAGE_HEAD = 1 + 8 + 2 + 4 + 8 + 8


class Place(NamedTuple):
    """A record from which reading can begin: number of the file, byte offset in it."""

    file: int
    offset: int


FIRST = Place(0, 0)


class RawMessage(NamedTuple):
    """One message as stored.

    `place` is its own record or the chunk that holds it; `log_ns` the time at which it was
    recorded, 0 in `McapFiles.heads`.
    """

    topic: str
    type: str
    data: bytes
    place: Place
    log_ns: int = 0


class IndexDamaged(Exception):
    """The index of a file contradicts its content; the file can be read forward."""


class McapFiles:
    """The messages of one or more MCAP files, in the order of the files.

    Args:
        paths: the files.
        checked: whether the checksums of all chunks are verified. Without it, the content of an
            uncompressed chunk is not verified, and reading takes a fifth of the time.

    Attributes:
        paths: the files.
        counts: topic -> number of messages, None for a damaged bag (known only after reading it).
        types: topic -> message type, of a whole bag; filled while reading a damaged one.
        latched: likewise, topics that were recorded latched: late subscribers got the last message.
        damage: where and why reading stopped early, None so far.

    Raises:
        DatasetError: a file is missing, unreadable or no MCAP at all.
    """

    def __init__(self, paths: Sequence[Path], *, checked: bool = True) -> None:
        self.paths = tuple(paths)
        self._checked = checked
        self.types: dict[str, str] = {}
        self.latched: set[str] = set()
        self.damage: str | None = None
        self.counts: dict[str, int] | None = {}
        self._summaries: list[Summary | None] = []
        # Definitions read so far, per file: a file need not repeat them in later chunks.
        self._schemas: list[dict[int, Schema]] = [{} for _ in self.paths]
        self._channels: list[dict[int, Channel]] = [{} for _ in self.paths]
        for path in self.paths:
            try:
                with path.open("rb") as file:
                    start = file.read(len(MAGIC))
            except OSError as error:
                raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
            if start != MAGIC:
                raise DatasetError(f"{path}: not an MCAP file (it starts with {start!r})")
            self._summaries.append(_summary(path))
        for number, summary in enumerate(self._summaries):
            self._take(number, summary)

    def _take(self, number: int, summary: Summary | None) -> None:
        if summary is None or summary.statistics is None:
            self.counts = None
            return
        self._schemas[number].update(summary.schemas)
        for channel_id, channel in summary.channels.items():
            self._add_channel(number, channel)
            if self.counts is not None:
                count = summary.statistics.channel_message_counts.get(channel_id, 0)
                self.counts[channel.topic] = self.counts.get(channel.topic, 0) + count

    def __iter__(self) -> Iterator[RawMessage]:
        """Every message before the first damage of each file."""
        return self.messages()

    def messages(self, start: Place = FIRST) -> Iterator[RawMessage]:
        """Every message from a place on, before the first damage of each file.

        Args:
            start: the place of a message that was read before.
        """
        for number in range(start.file, len(self.paths)):
            yield from self._messages(number, start.offset if number == start.file else 0)

    def heads(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """The messages of some topics with the first `HEAD_BYTES` of their data, in file order.

        Uses the indexes of chunks and messages: of uncompressed files only the bytes asked for are
        read. A bag without them is read forward.

        Raises:
            IndexDamaged: the index contradicts the file; messages yielded before are correct.
        """
        if self.counts is None or not all(map(_is_indexed, self._summaries)):
            yield from (message for message in self if message.topic in topics)
            return
        for number, (path, summary) in enumerate(zip(self.paths, self._summaries, strict=True)):
            wanted = {
                key for key, channel in self._channels[number].items() if channel.topic in topics
            }
            with path.open("rb") as file:
                chunks = summary.chunk_indexes if summary else []
                for chunk in sorted(chunks, key=lambda c: c.chunk_start_offset):
                    if wanted.isdisjoint(chunk.message_index_offsets):
                        continue
                    try:
                        heads = _heads(file, chunk, wanted, path.stat().st_size)
                    except Exception as error:  # damaged bytes raise any exception
                        raise IndexDamaged from error
                    place = Place(number, chunk.chunk_start_offset)
                    for channel_id, data in heads:
                        topic = self._channels[number][channel_id].topic
                        yield RawMessage(topic, self.types[topic], data, place)

    def _messages(self, number: int, offset: int) -> Iterator[RawMessage]:
        path = self.paths[number]
        with path.open("rb") as file:
            file.seek(offset)
            # No record is longer than its file: a damaged length must not allocate gigabytes.
            records = iter(
                StreamReader(
                    file,
                    skip_magic=offset > 0,
                    emit_chunks=True,
                    record_size_limit=path.stat().st_size,
                ).records
            )
            while True:
                place = Place(number, file.tell())
                plain = None if self._checked else plain_chunk(file, place.offset)
                if plain is not None:
                    yield from self._known(number, records_of(file, plain), place)
                    file.seek(plain.end)
                    continue
                try:
                    record = next(records, None)
                    parts = (
                        breakup_chunk(record, validate_crc=True)
                        if isinstance(record, Chunk)
                        else [record]
                    )
                except Exception as error:  # damaged bytes raise any exception
                    self.damage = (
                        f"{path}: cut or damaged, read up to there ({type(error).__name__})"
                    )
                    yield from self._known(number, intact_records(file, place.offset), place)
                    return
                if record is None:
                    return
                yield from self._known(number, parts, place)

    def _known(
        self, number: int, records: Iterable[McapRecord | None], place: Place
    ) -> Iterator[RawMessage]:
        """The messages among records of known topics; what defines topics is kept."""
        for record in records:
            self._define(number, record)
            if isinstance(record, Message) and record.channel_id in self._channels[number]:
                topic = self._channels[number][record.channel_id].topic
                yield RawMessage(topic, self.types[topic], record.data, place, record.log_time)

    def _define(self, number: int, record: McapRecord | None) -> None:
        if isinstance(record, Schema):
            self._schemas[number][record.id] = record
        elif isinstance(record, Channel):
            self._add_channel(number, record)

    def _add_channel(self, number: int, channel: Channel) -> None:
        self._channels[number][channel.id] = channel
        schema = self._schemas[number].get(channel.schema_id)
        self.types[channel.topic] = schema.name if schema else ""
        offered = _DURABILITY.findall(channel.metadata.get("offered_qos_profiles", ""))
        if offered and all(each in _TRANSIENT_LOCAL for each in offered):
            self.latched.add(channel.topic)


def _is_indexed(summary: Summary | None) -> bool:
    """Whether a file has indexes of its chunks, and of the messages in them."""
    chunks = summary.chunk_indexes if summary else []
    return bool(chunks) and all(chunk.message_index_offsets for chunk in chunks)


def _summary(path: Path) -> Summary | None:
    try:
        with path.open("rb") as file:
            return make_reader(file).get_summary()
    except Exception:  # damaged bytes raise any exception; the file can be read forward
        return None


def _heads(
    file: IO[bytes], chunk: ChunkIndex, wanted: set[int], limit: int
) -> list[tuple[int, bytes]]:
    """(channel, first `HEAD_BYTES`) of the wanted channels' messages in a chunk, in file order."""

    def record_at(offset: int, kind: type[Any]) -> Any:
        file.seek(offset)
        reader = StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=limit)
        record = next(iter(reader.records))
        if not isinstance(record, kind):
            raise IndexDamaged
        return record

    if chunk.compression:
        return [
            (part.channel_id, part.data[:HEAD_BYTES])
            for part in breakup_chunk(record_at(chunk.chunk_start_offset, Chunk))
            if isinstance(part, Message) and part.channel_id in wanted
        ]
    places: list[tuple[int, int]] = []
    for channel_id in wanted & chunk.message_index_offsets.keys():
        index = record_at(chunk.message_index_offsets[channel_id], MessageIndex)
        places += [(offset, channel_id) for _, offset in index.records]
    heads = []
    for offset, channel_id in sorted(places):
        file.seek(chunk.chunk_start_offset + _CHUNK_HEAD + offset)
        data = file.read(_MESSAGE_HEAD + HEAD_BYTES)
        if int.from_bytes(data[9:11], "little") != channel_id:
            raise IndexDamaged
        heads.append((channel_id, data[_MESSAGE_HEAD:]))
    return heads
