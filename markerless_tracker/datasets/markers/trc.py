"""OpenSim marker files (`.trc`), Y up as Pose2Sim writes them: world = (Z, X, Y) of the file."""

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
# Largest Time in a file: stamps in ns must fit in 64 bits.
LARGEST_TIME_S = Decimal(9_000_000_000)
CHUNK_ROWS = 4096
"""Rows that `TrcRows` reads at a time."""


def read_trc(path: str | Path) -> MarkerTrack:
    """Read a `.trc` in m, cm or mm; the Time column (s) decides the stamps: round(time * 1e9) ns.

    A blank, missing or NaN coordinate makes its marker missing (NaN) in that row.

    Raises:
        DatasetError: the file cannot be read or is malformed; the message names file and line.
    """
    with TrcRows(path) as rows:
        stamps, chunks = [np.empty(0, dtype=np.int64)], [np.empty((0, len(rows.names), 3))]
        for some, positions_m in rows.chunks():
            stamps.append(some)
            chunks.append(positions_m)
        return MarkerTrack(rows.names, np.concatenate(stamps), np.concatenate(chunks))


class TrcRows:
    """The rows of a `.trc`, a chunk at a time: memory does not grow with the file.

    Args:
        path: the file.

    Attributes:
        names: (m,) the markers.
        fps: rate that the header states, 1/s; NaN if it is no number.

    Raises:
        DatasetError: the file cannot be read or its header is malformed; names file and line.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = path = Path(path)
        try:
            self._file = path.open(encoding="utf-8-sig", errors="replace")
        except OSError as error:
            raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
        try:
            self._read_header()
        except DatasetError:
            self._file.close()
            raise

    def __enter__(self) -> "TrcRows":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def chunks(self, rows: int = CHUNK_ROWS) -> Iterator[tuple[NDArray[np.int64], FloatArray]]:
        """Stamps (k,) in ns and positions (k, m, 3) in m, world frame, of k <= `rows` rows.

        Raises:
            DatasetError: a row is malformed, or its time is not later than that of the row before.
        """
        stamps: list[int] = []
        values: list[list[float]] = []
        last: int | None = None
        done = 0
        for number, line in enumerate(self._lines(), start=6):
            if not line.strip():
                continue
            if not line.endswith("\n"):
                self._check_end(number, line, rows_before=done + len(stamps))
            stamp, row = _row(self._path, number, line, len(self.names))
            if last is not None and stamp <= last:
                raise DatasetError(
                    f"{self._path}: line {number}: Time {stamp / 1e9} s is not later than "
                    f"{last / 1e9} s"
                )
            last = stamp
            stamps.append(stamp)
            values.append(row)
            if len(stamps) == rows:
                yield self._arrays(stamps, values)
                done += len(stamps)
                stamps, values = [], []
        if stamps:
            yield self._arrays(stamps, values)

    def _check_end(self, number: int, line: str, rows_before: int) -> None:
        """Make sure that a last line without line break is whole: else its last number is not."""
        columns, expected = line.count("\t") + 1, 2 + 3 * len(self.names)
        stated = self._rows is not None and rows_before + 1 < self._rows
        if columns < expected and ((columns - 2) % 3 or stated):
            raise DatasetError(
                f"{self._path}: line {number}: ends after {columns} of {expected} columns, the "
                "file is cut"
            )

    def _arrays(
        self, stamps: list[int], values: list[list[float]]
    ) -> tuple[NDArray[np.int64], FloatArray]:
        positions = np.array(values, dtype=np.float64).reshape(len(values), -1, 3) * self._factor
        return np.array(stamps, dtype=np.int64), positions[:, :, [2, 0, 1]]

    def _lines(self) -> Iterator[str]:
        try:
            # `yield from` would close the file with the generator.
            for line in self._file:  # noqa: UP028
                yield line
        except OSError as error:
            raise DatasetError(f"{self._path}: cannot be read: {error.strerror}") from error

    def _read_header(self) -> None:
        path = self._path
        lines = [line.rstrip("\r\n") for line in islice(self._lines(), 5)]
        if not lines or not lines[0].startswith("PathFileType"):
            came = repr(lines[0][:20]) if lines else "nothing"
            raise DatasetError(
                f"{path}: no TRC marker file: line 1 begins with {came}, expected 'PathFileType'"
            )
        if len(lines) < 5:
            raise DatasetError(f"{path}: ends after line {len(lines)}, expected 5 lines of header")
        self.names = _names(path, lines[3])
        keys, values = ([cell.strip() for cell in line.split("\t")] for line in lines[1:3])
        header = dict(zip(keys, values, strict=False))
        self._factor = METRES[_units(path, header)]
        stated = header.get("NumFrames", "").strip()
        self._rows = int(stated) if stated.isdecimal() else None
        try:
            self.fps = float(header.get("DataRate", "nan"))
        except ValueError:
            self.fps = float("nan")


def write_trc(path: str | Path, track: MarkerTrack, fps: float) -> None:
    """Write a `.trc` in m with 6 decimals (µm) and times with 9 (ns); missing markers are blank.

    The text depends on the track, `fps` and the file's name, not on its folder.

    Raises:
        DatasetError: the file cannot be written.
    """
    path = Path(path)
    try:
        path.write_text(format_trc(track, fps, path.name), encoding="utf-8", newline="\n")
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written: {error.strerror}") from error


def format_trc(track: MarkerTrack, fps: float, name: str) -> str:
    """The text of a `.trc`; see `write_trc`.

    Args:
        track: the markers.
        fps: rate stated in the header, 1/s.
        name: file name without folder; line 1 states it.

    Raises:
        DatasetError: a marker's name cannot be written (tab, line break or empty).
    """
    lines = format_header(track.names, len(track), fps, name)
    for index, (stamp, row) in enumerate(
        zip(track.stamps_ns, track.positions_m, strict=True), start=1
    ):
        lines.append(format_row(index, int(stamp), row))
    return "\n".join(lines) + "\n"


def format_header(names: Sequence[str], rows: int, fps: float, name: str) -> list[str]:
    """The five header lines of a `.trc`, without line breaks; arguments as in `format_trc`.

    Raises:
        DatasetError: a marker's name cannot be written (tab, line break or empty).
    """
    for marker in names:
        if (
            not marker
            or marker != marker.strip()
            or len(marker.splitlines()) != 1
            or "\t" in marker
        ):
            raise DatasetError(f"marker name {marker!r} cannot be written to a marker file")
    count, rate = len(names), f"{fps:.10g}"
    # File names may hold what a header line in UTF-8 cannot: tabs, line breaks, undecoded bytes.
    title = " ".join(name.encode("utf-8", "replace").decode("utf-8").split())
    return [
        f"PathFileType\t4\t(X/Y/Z)\t{title}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate}\t{rate}\t{rows}\t{count}\tm\t{rate}\t1\t{rows}",
        "Frame#\tTime\t" + "".join(f"{marker}\t\t\t" for marker in names),
        "\t\t" + "".join(f"X{i}\tY{i}\tZ{i}\t" for i in range(1, count + 1)),
    ]


def format_row(index: int, stamp_ns: int, positions_m: FloatArray) -> str:
    """One data line of a `.trc`, without its line break.

    Args:
        index: Frame#, from 1.
        stamp_ns: time of the row.
        positions_m: (m, 3) markers in the world frame (Z up); NaN = missing, written as blanks.
    """
    cells = [cell for point in positions_m for cell in _cells(point)]
    line = "\t".join([str(index), seconds(stamp_ns), *cells])
    # OpenSim does not count an empty last cell unless a tab ends it.
    return line if cells and cells[-1] else line + "\t"


def seconds(stamp_ns: int) -> str:
    """A stamp in s, to the nanosecond."""
    sign = "-" if stamp_ns < 0 else ""
    return f"{sign}{abs(stamp_ns) // 10**9}.{abs(stamp_ns) % 10**9:09d}"


def _cells(point: FloatArray) -> tuple[str, ...]:
    if not np.isfinite(point).all():
        return "", "", ""
    x, y, z = point
    # + 0.0 after rounding: no "-0.000000".
    return tuple(f"{round(float(value), 6) + 0.0:.6f}" for value in (y, z, x))


def _units(path: Path, header: Mapping[str, str]) -> str:
    units = header.get("Units", "")
    if units.lower() not in METRES:
        raise DatasetError(
            f"{path}: line 3: Units is {units!r}, expected one of {', '.join(METRES)}"
        )
    return units.lower()


def _names(path: Path, line: str) -> tuple[str, ...]:
    cells = [cell.strip() for cell in line.rstrip().split("\t")]
    if [cell.lower() for cell in cells[:2]] != ["frame#", "time"]:
        raise DatasetError(f"{path}: line 4: starts with {cells[:2]}, expected Frame# and Time")
    names = tuple(cells[2::3])
    if not names or not all(names) or any(cells[3::3]) or any(cells[4::3]):
        raise DatasetError(f"{path}: line 4: expected marker names three columns apart")
    if len(set(names)) != len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise DatasetError(
            f"{path}: line 4: marker names must be distinct, {', '.join(twice)} repeats"
        )
    return names


def _row(path: Path, number: int, line: str, markers: int) -> tuple[int, list[float]]:
    cells = line.rstrip("\r\n").split("\t")
    coordinates = [cell.strip() for cell in cells[2:]]
    if len(cells) < 2 or any(coordinates[3 * markers :]):
        raise DatasetError(
            f"{path}: line {number}: {len(cells)} columns, expected at most {2 + 3 * markers} "
            f"(Frame#, Time and {markers} markers)"
        )
    try:
        time = Decimal(cells[1].strip())
        if not time.is_finite() or abs(time) > LARGEST_TIME_S:
            raise ValueError
        stamp = int((time * 10**9).to_integral_value())
    except (InvalidOperation, ValueError):
        raise DatasetError(
            f"{path}: line {number}: Time is {cells[1].strip()!r}, expected seconds"
        ) from None
    row = [np.nan] * (3 * markers)
    for column, cell in enumerate(coordinates[: 3 * markers]):
        if cell:
            try:
                row[column] = float(cell)
            except ValueError:
                raise DatasetError(
                    f"{path}: line {number}: column {column + 3} is {cell!r}, expected a number"
                ) from None
    return stamp, row
