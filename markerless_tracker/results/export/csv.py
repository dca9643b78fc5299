"""Tidy CSV: one row per frame and joint."""

from pathlib import Path

import numpy as np

from markerless_tracker.datasets.markers.trc import seconds
from markerless_tracker.results.export.axes import to_file
from markerless_tracker.results.export.new_file import new_file, number
from markerless_tracker.results.read import ResultReader

COLUMNS = ("time", "joint", "x", "y", "z", "sd", "state")


def write_csv(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write time (s), joint, x, y, z (m, Y up), sd (m) and state; unknown cells are empty.

    `sd` is the root of the summed variances along x, y and z. The state of an interpolated frame
    is FILLED.

    Args:
        path: the file.
        reader: the result.
        names: (15,) the joints' names.

    Raises:
        DatasetError: it cannot be written.
    """
    with new_file(path) as sink:
        sink.write(",".join(COLUMNS) + "\n")
        for part in reader.chunks():
            positions = to_file(part.positions_m)
            deviations = np.sqrt((part.positions_sd_m**2).sum(axis=2))
            for row, stamp in enumerate(part.stamps_ns.tolist()):
                time, state = seconds(stamp), part.states[row]
                if part.filled[row]:
                    state = "FILLED"
                for column, name in enumerate(names):
                    x, y, z = (number(value, 6) for value in positions[row, column].tolist())
                    sd = number(deviations[row, column], 6)
                    sink.write(f"{time},{name},{x},{y},{z},{sd},{state}\n")
