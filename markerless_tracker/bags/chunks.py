"""Writing of MCAP files without copies of large messages, with the records of the `mcap` library.

The library's own writer copies each message five times, which takes longer than decoding videos and
writing to memory together. Here the parts of a chunk remain the caller's arrays until they go to
the file. The bytes of the file are those that the library writes.
"""

import struct
import zlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

Part = bytes | memoryview
"""Bytes; of a memoryview those of one row of uint8."""
MAGIC = b"\x89MCAP0\r\n"
_MESSAGE = struct.Struct("<BQHIQQ")
"""Start of a message: opcode, length of what follows, channel, sequence, log and publish time."""
_CHUNK = struct.Struct("<BQQQQI")
"""Start of a chunk: opcode, length of what follows, first and last time, size, checksum."""
_OPCODE_AND_LENGTH = 9
_FOOTER = struct.Struct("<BQQQ")


class ChunkedFile:
    """An MCAP file in chunks, with indexes, statistics and checksums of chunks and summary.

    Args:
        file: empty, open for writing, buffered.
        library: name of the writer, as the file states it.
        zstd: whether chunks are compressed.
        chunk_bytes: a chunk ends once it is larger.
    """

    def __init__(
        self, file: BinaryIO, *, library: str, zstd: bool = False, chunk_bytes: int
    ) -> None:
        self._file, self._zstd, self._chunk_bytes = file, zstd, chunk_bytes
        self._position = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk_indexes: list[ChunkIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._statistics = Statistics(0, 0, defaultdict(int), 0, 0, 0, 0, 0, 0)
        self._parts: list[memoryview] = []
        self._size = 0
        self._times: list[int] = []
        self._indexes: dict[int, MessageIndex] = {}
        self._put([MAGIC, _bytes_of(Header("ros2", library))])

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a schema; its number."""
        number = len(self._schemas) + 1
        self._schemas.append(Schema(id=number, data=data, encoding=encoding, name=name))
        self._statistics.schema_count = number
        self._add([_bytes_of(self._schemas[-1])])
        return number

    def channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Declare a channel with messages of a schema; its number."""
        number = len(self._channels) + 1
        self._channels.append(
            Channel(
                id=number, topic=topic, message_encoding=encoding, metadata=dict(metadata),
                schema_id=schema,
            )
        )  # fmt: skip
        self._statistics.channel_count = number
        self._add([_bytes_of(self._channels[-1])])
        return number

    def message(self, channel: int, stamp_ns: int, number: int, parts: Sequence[Part]) -> None:
        """Write a message.

        Args:
            channel: its channel.
            stamp_ns: when it was sent and received.
            number: its number in the channel.
            parts: its bytes, in pieces; they must not change until the chunk has ended.
        """
        found = self._statistics
        first = stamp_ns if not found.message_count else min(found.message_start_time, stamp_ns)
        found.message_start_time = first
        found.message_end_time = max(found.message_end_time, stamp_ns)
        found.channel_message_counts[channel] += 1
        found.message_count += 1
        index = self._indexes.setdefault(channel, MessageIndex(channel, []))
        index.records.append((stamp_ns, self._size))
        self._times.append(stamp_ns)
        views = [memoryview(part) for part in parts]
        length = sum(map(len, views)) + _MESSAGE.size - _OPCODE_AND_LENGTH
        start = _MESSAGE.pack(Opcode.MESSAGE, length, channel, number, stamp_ns, stamp_ns)
        self._add([start, *views])

    def metadata(self, name: str, data: Mapping[str, str]) -> None:
        """Write a record of metadata."""
        record = _bytes_of(Metadata(name=name, metadata=dict(data)))
        self._metadata_indexes.append(MetadataIndex(self._position, len(record), name))
        self._statistics.metadata_count += 1
        self._put([record])

    def flush(self) -> None:
        """End the current chunk and give everything to the operating system."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """End the current chunk; write the summary. Does not close the file."""
        self._end_chunk()
        self._put([_bytes_of(DataEnd(0))])
        groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, []),
            (Opcode.METADATA_INDEX, self._metadata_indexes),
        ]
        start, summary, offsets = self._position, RecordBuilder(), RecordBuilder()
        for opcode, records in groups:
            before = summary.count
            for record in records:
                record.write(summary)
            SummaryOffset(opcode, start + before, summary.count - before).write(offsets)
        offsets_at = start + summary.count
        content = summary.end() + offsets.end()
        checked = _FOOTER.pack(Opcode.FOOTER, 8 + 8 + 4, start, offsets_at)
        checksum = zlib.crc32(checked, zlib.crc32(content))
        self._put([content, _bytes_of(Footer(start, offsets_at, checksum)), MAGIC])

    def _add(self, parts: Sequence[Part]) -> None:
        """Add to the current chunk; end it once it is large enough."""
        for part in parts:
            view = memoryview(part)
            self._parts.append(view)
            self._size += len(view)
        if self._size > self._chunk_bytes:
            self._end_chunk()

    def _end_chunk(self) -> None:
        # Schemas and channels wait for the first message.
        if not self._times:
            return
        checksum = 0
        for part in self._parts:
            checksum = zlib.crc32(part, checksum)
        content: list[memoryview] | list[bytes] = self._parts
        if self._zstd:
            content = [zstandard.compress(b"".join(self._parts))]
        size, first, last = sum(map(len, content)), min(self._times), max(self._times)
        kind = b"zstd" if self._zstd else b""
        about = struct.pack(f"<I{len(kind)}sQ", len(kind), kind, size)
        length = _CHUNK.size - _OPCODE_AND_LENGTH + len(about) + size
        start = _CHUNK.pack(Opcode.CHUNK, length, first, last, self._size, checksum)
        before = self._position
        self._put([start, about, *content])
        chunk_length, offsets, indexes = self._position - before, {}, RecordBuilder()
        for channel, index in self._indexes.items():
            offsets[channel] = self._position + indexes.count
            index.write(indexes)
        self._chunk_indexes.append(
            ChunkIndex(
                chunk_length=chunk_length, chunk_start_offset=before, compression=kind.decode(),
                compressed_size=size, message_end_time=last, message_index_length=indexes.count,
                message_index_offsets=offsets, message_start_time=first,
                uncompressed_size=self._size,
            )
        )  # fmt: skip
        self._put([indexes.end()])
        self._statistics.chunk_count += 1
        self._parts, self._size, self._times, self._indexes = [], 0, [], {}

    def _put(self, parts: Sequence[Part]) -> None:
        for part in parts:
            self._position += self._file.write(part)


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
