"""The writer of the `mcap` library, with fewer copies of large messages.

The library builds every record in a growing buffer, which takes longer than decoding videos and
writing to memory together. Here the pieces of a record are collected and joined once. The bytes of
the file are the same.
"""

import struct
from collections.abc import Sequence
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

Piece = bytes | memoryview
"""Bytes; a memoryview must be one-dimensional, of uint8."""
_START = struct.Struct("<BQ")
"""Start of a record: opcode, length of its content."""


class PieceWriter(Writer):
    """A writer whose messages may be sequences of pieces.

    Pieces must not change until the chunk has ended.

    Args:
        file: empty, open for writing, buffered.
        zstd: whether chunks are compressed.
        chunk_bytes: a chunk ends once it is larger.
    """

    def __init__(self, file: BinaryIO, *, zstd: bool, chunk_bytes: int) -> None:
        compression = CompressionType.ZSTD if zstd else CompressionType.NONE
        super().__init__(file, chunk_size=chunk_bytes, compression=compression)
        # The library's constructor does not accept other builders.
        self._Writer__record_builder = _PieceBuilder()
        self._Writer__chunk_builder.record_writer = _PieceBuilder()


class _PieceBuilder(RecordBuilder):
    """Builds records of pieces, joined at the end."""

    def __init__(self) -> None:
        self._pieces: list[Piece] = []
        self._count = self._record = self._begun = 0

    @property
    def count(self) -> int:
        """Bytes of all records so far."""
        return self._count

    def start_record(self, opcode: Opcode) -> None:
        """Begin a record; its length is filled in by `finish_record`."""
        self._record = len(self._pieces)
        self.write(_START.pack(opcode, 0))
        self._begun = self._count

    def finish_record(self) -> None:
        """End a record."""
        opcode = self._pieces[self._record][0]
        self._pieces[self._record] = _START.pack(opcode, self._count - self._begun)

    def write(self, data: Piece | Sequence[Piece]) -> None:
        """Add to the record."""
        for piece in [data] if isinstance(data, bytes | memoryview) else data:
            self._pieces.append(piece)
            self._count += len(piece)

    def end(self) -> bytes:
        """Return the bytes of all records, and clear the builder."""
        joined = b"".join(self._pieces)
        self._pieces, self._count = [], 0
        return joined
