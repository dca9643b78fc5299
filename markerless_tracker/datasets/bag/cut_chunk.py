"""The intact part of a truncated or damaged chunk."""

from collections.abc import Iterator
from io import SEEK_END, BytesIO
from typing import IO

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import McapRecord
from mcap.stream_reader import StreamReader

_RECORD_HEAD = 1 + 8
# Bytes of a chunk's fields before the name of its compression: two times, size, checksum.
_FIELDS = 8 + 8 + 8 + 4


def intact_records(file: IO[bytes], offset: int) -> Iterator[McapRecord]:
    """The complete records at the start of a chunk whose end is missing, in order.

    Of an uncompressed chunk these are all that the file holds in full; of a compressed one those
    whose bytes can still be decompressed.

    Args:
        file: open for reading.
        offset: byte at which the chunk begins; nothing is yielded if there is none, or if the
            whole chunk is in the file.
    """
    file.seek(offset)
    head = file.read(_RECORD_HEAD)
    if len(head) < _RECORD_HEAD or head[0] != Opcode.CHUNK:
        return
    length = int.from_bytes(head[1:], "little")
    # A damaged length must not ask for more memory than the file has bytes.
    begin = file.tell()
    rest = file.seek(0, SEEK_END) - begin
    file.seek(begin)
    body = file.read(min(length, rest))
    if len(body) == length:
        # It is damaged somewhere inside: none of its bytes can be trusted.
        return
    data = _decompressed(body)
    if not data:
        return
    records = iter(
        StreamReader(BytesIO(data), skip_magic=True, record_size_limit=len(data)).records
    )
    while True:
        try:
            record = next(records, None)
        except Exception:  # the cut ends the records with any exception
            return
        if record is None:
            return
        yield record


def _decompressed(body: bytes) -> bytes:
    """What can be read of the records in the fields of a cut chunk."""
    name_end = _FIELDS + 4 + int.from_bytes(body[_FIELDS : _FIELDS + 4], "little")
    name = body[_FIELDS + 4 : name_end]
    packed = body[name_end + 8 :]
    if len(name) < name_end - _FIELDS - 4:
        return b""
    try:
        if name == b"zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(packed)
        if name == b"lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed))
    except (zstandard.ZstdError, RuntimeError):
        return b""
    return b"" if name else packed
