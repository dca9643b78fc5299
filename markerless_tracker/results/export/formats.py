"""The formats by name."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from markerless_tracker.results.export.bvh import write_bvh
from markerless_tracker.results.export.c3d import write_c3d
from markerless_tracker.results.export.csv import write_csv
from markerless_tracker.results.export.grid import Grid
from markerless_tracker.results.export.humaneva_xml import write_humaneva
from markerless_tracker.results.export.mot import write_mot
from markerless_tracker.results.export.npz import write_npz
from markerless_tracker.results.export.osim import write_osim
from markerless_tracker.results.export.trc import write_renamed_trc
from markerless_tracker.results.read import ResultReader

Notes = list[str]
"""What the user should know about a file, one line each."""


def _c3d(path: Path, reader: ResultReader, names: tuple[str, ...]) -> Notes:
    return _uneven(path, write_c3d(path, reader, names))


def _bvh(path: Path, reader: ResultReader, names: tuple[str, ...]) -> Notes:
    grid, repeated = write_bvh(path, reader, names)
    notes = _uneven(path, grid)
    if repeated:
        notes.append(
            f"{path}: {repeated} frames without a pose repeat the last one: BVH has no empty frames"
        )
    return notes


def _plain(
    write: Callable[[Path, ResultReader, tuple[str, ...]], None],
) -> Callable[[Path, ResultReader, tuple[str, ...]], Notes]:
    def wrapped(path: Path, reader: ResultReader, names: tuple[str, ...]) -> Notes:
        write(path, reader, names)
        return []

    return wrapped


def _uneven(path: Path, grid: Grid) -> Notes:
    notes = []
    if grid.left_out:
        notes.append(
            f"{path}: {grid.left_out} frames left out: they follow the one before in less than "
            f"half a period at {grid.fps:g} Hz"
        )
    if grid.most_off_s * grid.fps > MOST_OFF_FRAMES:
        notes.append(
            f"{path}: times are up to {1000.0 * grid.most_off_s:.1f} ms off, since the format has "
            "one rate and the frames are not evenly spaced"
        )
    return notes


MOST_OFF_FRAMES = 0.05
"""Difference of a frame's time from its place at the constant rate that is not reported."""

EXPORTS: Mapping[str, Callable[[Path, ResultReader, tuple[str, ...]], Notes]] = MappingProxyType(
    {
        "bvh": _bvh,
        "c3d": _c3d,
        "csv": _plain(write_csv),
        "humaneva.xml": _plain(write_humaneva),
        "mot": _plain(write_mot),
        "npz": _plain(write_npz),
        "osim": _plain(write_osim),
        "trc": _plain(write_renamed_trc),
    }
)
"""Format -> function that writes a file with it and returns its notes."""

MORE_FILES: Mapping[str, tuple[str, ...]] = MappingProxyType({"osim": (".ik.xml", ".ik.trc")})
"""Files, by their endings, that a format writes beside NAME.FORMAT."""
