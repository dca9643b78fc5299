"""NumPy archive with every array of a result."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.results.export.axes import DESCRIPTION, to_file
from markerless_tracker.results.export.new_file import new_file
from markerless_tracker.results.read import ResultReader
from markerless_tracker.results.stored_result import StoredResult

_ARRAYS: dict[str, Callable[[StoredResult], NDArray[Any]]] = {
    "times_s": lambda part: part.times_s,
    "stamps_ns": lambda part: part.stamps_ns,
    "states": lambda part: part.states,
    "filled": lambda part: part.filled,
    "fitness": lambda part: part.fitness,
    "positions_m": lambda part: to_file(part.positions_m),
    "positions_sd_m": lambda part: to_file(part.positions_sd_m),
    "parameters": lambda part: part.parameters,
    "parameters_sd": lambda part: part.parameters_sd,
    "angles_deg": lambda part: part.angles_deg,
}


def write_npz(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write the arrays of `StoredResult`, positions Y up, and `marker_names`, `axes`, `fps`.

    `numpy.load(path)` reads them. One pass over the result per array keeps memory flat.

    Args:
        path: the file.
        reader: the result.
        names: (15,) the markers' names.

    Raises:
        DatasetError: it cannot be written.
    """
    frames = sum(len(part) for part in reader.chunks())
    with new_file(path, binary=True) as sink, zipfile.ZipFile(sink, "w") as archive:
        for name, array_of in _ARRAYS.items():
            with archive.open(_entry(name), "w", force_zip64=True) as entry:
                for index, part in enumerate(reader.chunks()):
                    array = np.ascontiguousarray(array_of(part))
                    if not index:
                        np.lib.format.write_array_header_2_0(
                            entry,
                            {
                                "descr": np.lib.format.dtype_to_descr(array.dtype),
                                "fortran_order": False,
                                "shape": (frames, *array.shape[1:]),
                            },
                        )
                    entry.write(array.tobytes())
        for name, value in (
            ("marker_names", np.array(names)),
            ("parameter_names", np.array(reader.parameter_names, dtype=np.str_)),
            ("angle_names", np.array(reader.angle_names, dtype=np.str_)),
            ("axes", np.array(DESCRIPTION)),
            ("fps", np.array(reader.fps)),
        ):
            buffer = io.BytesIO()
            np.save(buffer, value)
            archive.writestr(_entry(name), buffer.getvalue())


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry without the time of writing: the same result gives the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy")
