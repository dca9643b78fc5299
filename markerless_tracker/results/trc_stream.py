"""A `.trc` that is complete after every row."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from markerless_tracker.datasets.markers.trc import format_header, format_row
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.appended import AppendedFile, not_written

_RATE_LINE = 2
# DataRate, CameraRate, NumFrames, OrigDataRate, OrigNumFrames.
_VARIABLE_CELLS = (0, 1, 2, 5, 7)
_DIGITS = 16


class TrcStream:
    """Appends rows to a marker file; the header's NumFrames follows each row.

    Meanwhile the numbers of the header are filled up with zeros to a fixed width; `finish` writes
    them as `datasets.write_trc` does: the same rows then give the same bytes.

    Args:
        path: the file; an earlier one is replaced.
        names: of the markers.
        fps: rate, 1/s.

    Attributes:
        path: the file.
        rows: rows written.
        last_ns: stamp of the last row, None before the first.

    Raises:
        DatasetError: the file cannot be written.
    """

    def __init__(self, path: Path, names: Sequence[str], fps: float) -> None:
        self.path = path
        self.rows = 0
        self.last_ns: int | None = None
        self._finished = False
        self._names = names
        self._file = AppendedFile(path)
        self._file.append(self._fixed_header(fps))
        self._header_size = self._file.size

    def add(self, stamp_ns: int, positions_m: FloatArray, fps: float) -> None:
        """Append a row; all of it or nothing.

        Args:
            stamp_ns: its time, later than `last_ns`.
            positions_m: (m, 3) in m, world frame; NaN = missing.
            fps: rate that the header states from now on, 1/s.

        Raises:
            DatasetError: the row cannot be written.
        """
        self._file.append(_text([format_row(self.rows + 1, stamp_ns, positions_m)]))
        self.rows, self.last_ns = self.rows + 1, stamp_ns
        self._file.rewrite(0, self._fixed_header(fps))

    def finish(self, fps: float, title: str | None = None) -> None:
        """Write the header in its final form and close the file; a second call does nothing.

        Args:
            fps: rate, 1/s.
            title: file name in line 1; None = that of the file.

        Raises:
            DatasetError: there is no room for the new file; the old one stays, it has every row.
        """
        if self._finished:
            return
        self._file.close()
        final = self.path.with_name(self.path.name + ".tmp")
        try:
            with self.path.open("rb") as rows, final.open("wb") as sink:
                sink.write(
                    _text(format_header(self._names, self.rows, fps, title or self.path.name))
                )
                rows.seek(self._header_size)
                shutil.copyfileobj(rows, sink)
            os.replace(final, self.path)
            self._finished = True
        except OSError as error:
            raise not_written(self.path, error) from error
        finally:
            final.unlink(missing_ok=True)

    def _fixed_header(self, fps: float) -> bytes:
        lines = format_header(self._names, self.rows, fps, self.path.name)
        cells = lines[_RATE_LINE].split("\t")
        for cell in _VARIABLE_CELLS:
            cells[cell] = cells[cell].zfill(_DIGITS)
        lines[_RATE_LINE] = "\t".join(cells)
        return _text(lines)


def _text(lines: Sequence[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
