"""Writes and reads a learned background as a file, stored beside the calibration."""

import os
import zipfile
import zlib
from pathlib import Path

import numpy as np

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging.background.model import BackgroundModel, Mode

SUFFIX = ".npz"
_VERSION = 1
_DAMAGED = (
    ValueError, KeyError, TypeError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error
)  # fmt: skip
"""What NumPy raises for damaged archives and for others' files."""


def write_background_model(path: Path, model: BackgroundModel) -> None:
    """Write a model (NumPy's `.npz`, compressed; the same model gives the same bytes).

    The file is replaced when the new one is complete.

    Raises:
        ImageError: the file cannot be written.
    """
    arrays = {
        "version": np.int64(_VERSION),
        "mean": model.mean,
        "variance": model.variance,
        "note": np.frombuffer(model.note.encode(), dtype=np.uint8),
    }
    for k, mode in enumerate(model.modes):
        arrays |= {
            f"weight_{k}": mode.weight,
            f"mean_{k}": mode.mean,
            f"variance_{k}": mode.variance,
        }
    part = path.with_name(f"{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            # An open file, since NumPy would append its own suffix to other names.
            with part.open("wb") as file:
                np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
            os.replace(part, path)
        except OSError:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise ImageError(f"{path}: cannot be written: {error.strerror}") from error


def read_background_model(path: Path) -> BackgroundModel:
    """Read a model written by `write_background_model`.

    Raises:
        ImageError: the file cannot be read or holds something else.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            if int(data["version"]) != _VERSION:
                raise ImageError(
                    f"background model of version {int(data['version'])}, expected {_VERSION}"
                )
            modes: list[Mode] = []
            while f"weight_{len(modes)}" in data:
                k = len(modes)
                modes.append(Mode(data[f"weight_{k}"], data[f"mean_{k}"], data[f"variance_{k}"]))
            note = data["note"].tobytes().decode()
            return BackgroundModel(data["mean"], data["variance"], note, tuple(modes))
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror or error}") from error
    except _DAMAGED as error:
        what = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ImageError(f"{path}: no background model: {what}") from error
