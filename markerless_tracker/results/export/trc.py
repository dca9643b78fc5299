"""TRC files of a result with other marker names or without its blank rows."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.markers.trc import format_header, format_row
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.read import ResultReader


def write_renamed_trc(
    path: Path, reader: ResultReader, names: tuple[str, ...], *, blank_rows: bool = True
) -> None:
    """Write the markers under other names, as `datasets.write_trc` does.

    Args:
        path: the file.
        reader: the result.
        names: (15,) the markers' names.
        blank_rows: whether frames without a pose are written, as blank rows.

    Raises:
        DatasetError: it cannot be written.
    """

    def shown(positions_m: FloatArray) -> NDArray[np.bool_]:
        return np.asarray(np.isfinite(positions_m).any(axis=(1, 2)) | blank_rows)

    rows = sum(int(shown(part.positions_m).sum()) for part in reader.chunks())
    with new_file(path) as sink:
        sink.write("\n".join(format_header(names, rows, reader.fps, path.name)) + "\n")
        number = 0
        for part in reader.chunks():
            for row in np.flatnonzero(shown(part.positions_m)).tolist():
                number += 1
                stamp = int(part.stamps_ns[row])
                sink.write(format_row(number, stamp, part.positions_m[row]) + "\n")
