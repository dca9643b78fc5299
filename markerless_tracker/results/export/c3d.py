"""C3D files: markers in mm, as the C3D user guide (Motion Lab Systems, 2008) describes them."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from markerless_tracker.errors import DatasetError
from markerless_tracker.results.export.axes import to_file
from markerless_tracker.results.export.grid import Grid
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.read import ResultReader

_BLOCK = 512
_LARGEST = 65535
_INTEL = 84
_MM_PER_M = 1000.0
# A negative scale says that the data are floating point.
_SCALE = -1.0


def write_c3d(path: Path, reader: ResultReader, names: tuple[str, ...]) -> Grid:
    """Write the markers in mm, Y up, at the constant rate of the result.

    A marker without a position has the residual -1. Frames between rows that are more than one
    period apart are empty. The first row is frame 1; `TRACKER:FIRST_NS` holds its stamp.

    Args:
        path: the file.
        reader: the result.
        names: (15,) the markers' labels.

    Returns:
        The constant rate, with what it left out.

    Raises:
        DatasetError: the file cannot be written, or the result has no frame.
    """
    grid = Grid(reader)
    frames = grid.frames()
    if not frames:
        raise DatasetError(f"{reader.name}: no frame, expected at least one")
    with new_file(path, binary=True) as sink:
        parameters = _parameters(grid, frames, names)
        sink.write(_header(grid, frames, len(names), len(parameters) // _BLOCK))
        sink.write(parameters)
        written = 0
        for part in grid.parts():
            written += _write_points(sink, part.part.positions_m[part.rows], part.rows < 0)
        sink.write(b"\0" * (-written % _BLOCK))
    return grid


def _write_points(sink: IO[Any], positions_m: Any, empty: Any) -> int:
    points = to_file(positions_m) * _MM_PER_M
    missing = ~np.isfinite(points).all(axis=2) | empty[:, None]
    points[missing] = 0.0
    rows = np.concatenate([points, np.where(missing, -1.0, 0.0)[..., None]], axis=2)
    data = rows.astype("<f4").tobytes()
    sink.write(data)
    return len(data)


def _header(grid: Grid, frames: int, points: int, parameter_blocks: int) -> bytes:
    last = min(frames, _LARGEST)
    head = struct.pack(
        "<BBHHHHHfHHf", 2, 0x50, points, 0, 1, last, 0, _SCALE, 2 + parameter_blocks, 0, grid.fps
    )
    return head.ljust(_BLOCK, b"\0")


def _parameters(grid: Grid, frames: int, names: Sequence[str]) -> bytes:
    """The parameter section, in whole blocks."""
    count = min(frames, _LARGEST)
    last_words = [frames % 65536, frames // 65536]
    width = max(len(name.encode()) for name in names)

    def section(data_start: int) -> bytes:
        groups: list[tuple[str, list[bytes]]] = [
            (
                "POINT",
                [
                    _integers(1, "USED", [len(names)]),
                    _reals(1, "SCALE", [_SCALE]),
                    _reals(1, "RATE", [grid.fps]),
                    _integers(1, "DATA_START", [data_start]),
                    _integers(1, "FRAMES", [count]),
                    _reals(1, "LONG_FRAMES", [float(frames)]),
                    _texts(1, "LABELS", names, width),
                    _texts(1, "DESCRIPTIONS", names, width),
                    _text(1, "UNITS", "mm"),
                    _text(1, "X_SCREEN", "+X"),
                    _text(1, "Y_SCREEN", "+Y"),
                ],
            ),
            ("ANALOG", [_integers(2, "USED", [0]), _reals(2, "RATE", [0.0])]),
            (
                "TRIAL",
                [
                    _integers(3, "ACTUAL_START_FIELD", [1, 0], dimensions=(2,)),
                    _integers(3, "ACTUAL_END_FIELD", last_words, dimensions=(2,)),
                    _reals(3, "CAMERA_RATE", [grid.fps]),
                ],
            ),
            ("FORCE_PLATFORM", [_integers(4, "USED", [0])]),
            ("TRACKER", [_text(5, "FIRST_NS", str(grid.first_ns))]),
        ]
        body = b""
        for number, (name, entries) in enumerate(groups, start=1):
            body += _record(name, -number, b"") + b"".join(entries)
        return body

    blocks = -(-(len(section(0)) + 5) // _BLOCK)
    # Block 1 is the header.
    body = bytes([1, 0x50, blocks, _INTEL]) + section(2 + blocks)
    return body.ljust(blocks * _BLOCK, b"\0")


def _record(name: str, group: int, data: bytes) -> bytes:
    """A group (negative number) or a parameter, with an empty description."""
    head = struct.pack("<bb", len(name), group) + name.encode("ascii")
    return head + struct.pack("<h", len(data) + 3) + data + b"\0"


def _array(kind: int, dimensions: Sequence[int], data: bytes) -> bytes:
    return struct.pack(f"<bB{len(dimensions)}B", kind, len(dimensions), *dimensions) + data


def _integers(
    group: int, name: str, values: Sequence[int], *, dimensions: Sequence[int] = ()
) -> bytes:
    return _record(name, group, _array(2, dimensions, struct.pack(f"<{len(values)}H", *values)))


def _reals(group: int, name: str, values: Sequence[float]) -> bytes:
    return _record(name, group, _array(4, (), struct.pack(f"<{len(values)}f", *values)))


def _text(group: int, name: str, value: str) -> bytes:
    data = value.encode("ascii")
    return _record(name, group, _array(-1, (len(data),), data))


def _texts(group: int, name: str, values: Sequence[str], width: int) -> bytes:
    data = b"".join(value.encode().ljust(width) for value in values)
    return _record(name, group, _array(-1, (width, len(values)), data))
