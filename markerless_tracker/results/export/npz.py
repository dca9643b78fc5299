"""NumPy archive with every array of a result."""

import io
import shutil
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import ExitStack
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
    "angles_sd_deg": lambda part: part.angles_sd_deg,
    "overlap": lambda part: part.overlap,
}


def write_npz(path: Path, reader: ResultReader, names: tuple[str, ...]) -> None:
    """Write the arrays of `StoredResult`, positions Y up, and `marker_names`, `axes`, `fps`.

    `numpy.load(path)` reads them. Each array is first written to its own file beside `path`, so
    that memory does not grow with the frames.

    Args:
        path: the file.
        reader: the result.
        names: (15,) the markers' names.

    Raises:
        DatasetError: it cannot be written.
    """
    with (
        new_file(path, binary=True) as sink,
        tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder,
        zipfile.ZipFile(sink, "w") as archive,
    ):
        frames = 0
        kinds: dict[str, NDArray[Any]] = {}
        with ExitStack() as files:
            rows = {name: files.enter_context((Path(folder) / name).open("wb")) for name in _ARRAYS}
            for part in reader.chunks():
                frames += len(part)
                for name, array_of in _ARRAYS.items():
                    array = np.ascontiguousarray(array_of(part))
                    kinds[name] = array[:0]
                    rows[name].write(array.tobytes())
        for name, kind in kinds.items():
            with archive.open(_entry(name), "w", force_zip64=True) as entry:
                np.lib.format.write_array_header_2_0(
                    entry,
                    {
                        "descr": np.lib.format.dtype_to_descr(kind.dtype),
                        "fortran_order": False,
                        "shape": (frames, *kind.shape[1:]),
                    },
                )
                with (Path(folder) / name).open("rb") as stored:
                    shutil.copyfileobj(stored, entry, 1 << 20)
        for name, value in (
            ("marker_names", np.array(names)),
            ("parameter_names", np.array(reader.parameter_names, dtype=np.str_)),
            ("angle_names", np.array(reader.angle_names, dtype=np.str_)),
            ("camera_names", np.array(reader.camera_names, dtype=np.str_)),
            ("axes", np.array(DESCRIPTION)),
            ("fps", np.array(reader.fps)),
        ):
            buffer = io.BytesIO()
            np.save(buffer, value)
            archive.writestr(_entry(name), buffer.getvalue())


def _entry(name: str) -> zipfile.ZipInfo:
    """An entry without the time of writing: the same result gives the same bytes."""
    return zipfile.ZipInfo(f"{name}.npy")
