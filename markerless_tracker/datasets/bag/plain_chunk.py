"""Records of an uncompressed chunk, each read from the file with one copy and without checksum."""

import os
from collections.abc import Iterator
from io import BytesIO
from typing import IO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Message, Schema

# Bytes of a record before its content: opcode and length.
_RECORD_HEAD = 1 + 8
# Bytes of a chunk's fields before the length of its compression's name: two times, size, checksum.
_BEFORE_NAME = 8 + 8 + 8 + 4
# All its fields if that name is empty: then follows the length of the records.
_FIELDS = _BEFORE_NAME + 4 + 8
# Bytes of a message's fields before its data: channel, sequence and two times.
_MESSAGE_FIELDS = 2 + 4 + 8 + 8
_DEFINITIONS: dict[int, type[Schema] | type[Channel]] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
}


class MessagePlace(NamedTuple):
    """Where a message's content lies in its file: offset and length in bytes."""

    offset: int
    length: int


class PlainChunk(NamedTuple):
    """The records of an uncompressed chunk.

    Attributes:
        records: schemas, channels, and the places of messages, in order.
        end: offset of the first byte after the chunk.
    """

    records: list[Schema | Channel | MessagePlace]
    end: int


def plain_chunk(file: IO[bytes], offset: int) -> PlainChunk | None:
    """The records of the chunk at an offset.

    None if there is no chunk, if it is compressed or cut, or if its records do not fill it exactly.

    Args:
        file: open for reading; its position does not change.
        offset: byte at which the chunk begins.
    """
    number = file.fileno()
    head = os.pread(number, _RECORD_HEAD + _FIELDS, offset)
    if len(head) < _RECORD_HEAD + _FIELDS or head[0] != Opcode.CHUNK:
        return None
    named = _uint(head[_RECORD_HEAD + _BEFORE_NAME :][:4])
    at = offset + _RECORD_HEAD + _FIELDS
    end = at + _uint(head[-8:])
    whole = offset + _RECORD_HEAD + _uint(head[1:_RECORD_HEAD])
    if named or end != whole or end > os.fstat(number).st_size:
        return None
    records: list[Schema | Channel | MessagePlace] = []
    while at + _RECORD_HEAD <= end:
        head = os.pread(number, _RECORD_HEAD, at)
        place = MessagePlace(at + _RECORD_HEAD, _uint(head[1:]))
        at = sum(place)
        if at > end:
            return None
        if head[0] == Opcode.MESSAGE:
            if place.length < _MESSAGE_FIELDS:
                return None
            records.append(place)
        elif head[0] in _DEFINITIONS:
            content = ReadDataStream(BytesIO(os.pread(number, place.length, place.offset)))
            try:
                records.append(_DEFINITIONS[head[0]].read(content))
            except Exception:  # damaged bytes raise any exception
                return None
    return PlainChunk(records, end) if at == end else None


def records_of(file: IO[bytes], chunk: PlainChunk) -> Iterator[McapRecord]:
    """The messages of a chunk, and the definitions of their topics.

    Args:
        file: the file of the chunk; its position does not change.
        chunk: from `plain_chunk`.
    """
    number = file.fileno()
    for record in chunk.records:
        if not isinstance(record, MessagePlace):
            yield record
            continue
        fields = os.pread(number, _MESSAGE_FIELDS, record.offset)
        length, offset = record.length - _MESSAGE_FIELDS, record.offset + _MESSAGE_FIELDS
        yield Message(
            channel_id=_uint(fields[:2]),
            sequence=_uint(fields[2:6]),
            log_time=_uint(fields[6:14]),
            publish_time=_uint(fields[14:]),
            data=os.pread(number, length, offset),
        )


def _uint(content: bytes) -> int:
    return int.from_bytes(content, "little")
