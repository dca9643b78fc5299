"""Marker trajectories of C3D files, read with ezc3d."""

from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.markers.trc import METRES, read_trc
from markerless_tracker.errors import DatasetError

# Column of the file for each axis of the world, by the axis that is up.
_WORLD = {"+Y": [2, 0, 1], "+Z": [0, 1, 2]}
_UP = "+Z"
_BLOCK = 512
"""Bytes of a block; sections begin at blocks."""
_KEY = 0x50
"""Second byte of every C3D file."""
_PROCESSORS = {84: ("<", 15), 85: ("<", 13), 86: (">", 12)}
"""Processor type (Intel, DEC, MIPS) -> byte order, byte of the header with the scale's sign."""


def read_markers(path: str | Path) -> MarkerTrack:
    """Read a `.c3d`, or a `.trc` of any other name.

    Raises:
        DatasetError: the file cannot be read or is malformed.
    """
    return read_c3d(path) if Path(path).suffix.lower() == ".c3d" else read_trc(path)


def read_c3d(path: str | Path) -> MarkerTrack:
    """Read the points of a C3D file.

    POINT:UNITS states m, cm or mm (without it: mm). POINT:Y_SCREEN +Y means that y is up (world =
    (z, x, y)), else z is. The time of a frame is its number, from 0, over the rate; in files of
    `export` TRACKER:FIRST_NS is the stamp of the first one. Points with a negative residual or at
    the origin are missing. Labels that repeat or are empty are left out after the first.

    Raises:
        DatasetError: ezc3d is not installed, or the file cannot be read or states an unknown unit.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise DatasetError(f"{path}: reading C3D needs ezc3d: pip install ezc3d") from error
    _check_whole(Path(path))
    try:
        content = ezc3d.c3d(str(path))
        points = np.array(content["data"]["points"][:3], dtype=np.float64)
        parameters = content["parameters"]
        # A field holds 255 labels; further ones are in LABELS2, LABELS3, ...
        fields = ("LABELS", *(f"LABELS{number}" for number in range(2, 100)))
        held = [parameters["POINT"].get(field, {}).get("value", []) for field in fields]
        labels = [str(label).strip() for part in held for label in part][: points.shape[1]]
        rate = float(content["header"]["points"]["frame_rate"])
        first = int(content["header"]["points"]["first_frame"])
    except Exception as error:  # ezc3d raises what the C++ library throws
        raise DatasetError(f"{path}: cannot be read as C3D: {error}") from error
    if not 0.0 < rate < 1e6:
        raise DatasetError(f"{path}: the rate is {rate}, expected above 0")
    units = _text(parameters, "UNITS") or "mm"
    if units not in METRES:
        raise DatasetError(f"{path}: POINT:UNITS is {units!r}, expected {', '.join(METRES)}")
    # Optional: written by `export`.
    start = parameters.get("TRACKER", {}).get("FIRST_NS", {}).get("value")
    offset = int(start[0]) if start else round(first * 1e9 / rate)
    stamps = offset + np.rint(np.arange(points.shape[2]) * (1e9 / rate)).astype(np.int64)
    positions = points.transpose(2, 1, 0) * METRES[units]
    positions[(positions == 0.0).all(axis=2)] = np.nan
    columns = {label: column for column, label in reversed(list(enumerate(labels))) if label}
    names = tuple(label for label in dict.fromkeys(labels) if label)
    world = _WORLD.get(_text(parameters, "Y_SCREEN"), _WORLD[_UP])
    chosen = positions[:, [columns[name] for name in names]][:, :, world]
    return MarkerTrack(names, stamps, chosen)


def _check_whole(path: Path) -> None:
    """Make sure that a file has the sections that its header states: ezc3d hangs on cut ones.

    Raises:
        DatasetError: it cannot be read, is no C3D file, or is shorter.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_BLOCK)
            file.seek((max(head[0], 1) - 1) * _BLOCK if head else 0)
            section = file.read(4)
            size = path.stat().st_size
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
    if len(head) < _BLOCK or head[1] != _KEY:
        raise DatasetError(f"{path}: cannot be read as C3D: no header of {_BLOCK} bytes")
    least = (head[0] - 1 + (section[2] if len(section) == 4 else 1)) * _BLOCK
    order, sign = _PROCESSORS.get(section[3] if len(section) == 4 else 0, ("<", 15))
    points, analog, first, last = np.frombuffer(head, f"{order}u2", 4, offset=2).astype(int)
    # A negative scale (bytes 12 to 15) means numbers of 4 bytes.
    floats = head[sign] >= 128
    data = int(np.frombuffer(head, f"{order}u2", 1, offset=16)[0])
    if data > 0:
        frame_bytes = (4 * points + analog) * (4 if floats else 2)
        least = max(least, (data - 1) * _BLOCK + max(0, last - first + 1) * frame_bytes)
    if size < least:
        raise DatasetError(
            f"{path}: cannot be read as C3D: {size} bytes, its header states at least {least}: "
            "the file is cut"
        )


def _text(parameters: Any, name: str) -> str:
    value = parameters["POINT"].get(name, {}).get("value") or [""]
    return str(value[0]).strip()
