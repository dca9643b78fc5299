"""Keys of runs: a hash of everything that a run's numbers depend on.

Stored runs with the same key are not repeated, so that an interrupted table can be continued.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import markerless_tracker
from markerless_tracker.datasets.folder import CALIBRATION
from markerless_tracker.datasets.recording import BACKGROUND
from markerless_tracker.datasets.source import calibration_beside, session_folder
from markerless_tracker.datasets.truth import truth_path
from markerless_tracker.resources import config_dir
from markerless_tracker.results.result import versions

_PACKAGE = Path(markerless_tracker.__file__).resolve().parent


def run_key(parts: Mapping[str, Any]) -> str:
    """Key of a run: of the given JSON values, the versions, the code and the shipped bodies."""
    whole = {"versions": versions(), "code": code_key(), **parts}
    return _digest(json.dumps(whole, sort_keys=True).encode())


def recording_key(path: Path, *, without: Path | None = None) -> str:
    """Key of a recording: names, sizes and modification times of its files.

    Args:
        path: the folder, links in it included, or a bag's file: the calibration, the background
            and the reference markers beside it belong to it. To a trial that is named by one of
            its files belongs the whole session. A calibration elsewhere that it uses counts as
            well.
        without: a folder in it that is left out, such as that of the results; not the recording
            itself.

    Raises:
        OSError: there is no such file, or it cannot be read.
    """
    session = session_folder(path)
    if session.is_dir():
        files = list(_files(session, without))
    else:
        beside = (path.parent / CALIBRATION, truth_path(path))
        files = [path, *(file for file in beside if file.is_file())]
        files += _files(path.parent / BACKGROUND, without)
    shared = calibration_beside(path)
    if shared is not None:
        files += [shared] if shared.is_file() else _files(shared, without)
    stated: list[Any] = [os.path.relpath(path, session)]
    for file in files:
        status = file.stat()
        place = Path(os.path.relpath(file, path.parent)).as_posix()
        stated.append([place, status.st_size, status.st_mtime_ns])
    return _digest(json.dumps(stated).encode())


def file_key(path: Path) -> str:
    """Key of a file's content; of its name if there is no such file."""
    return _digest(path.read_bytes() if path.is_file() else str(path).encode())


@cache
def code_key() -> str:
    """Key of the package's whole source and of the bodies it ships."""
    return _digest(b"\0".join(file.read_bytes() for file in code_files()))


def code_files() -> list[Path]:
    """Files on which `code_key` depends."""
    return sorted(_PACKAGE.rglob("*.py")) + sorted((config_dir() / "bodies").glob("*.yaml"))


def _files(folder: Path, without: Path | None) -> Iterator[Path]:
    """The files in a folder, in a fixed order; linked folders are entered, each folder once."""
    entered = set() if without is None else {os.path.realpath(without)}
    entered.discard(os.path.realpath(folder))
    for place, folders, names in os.walk(folder, followlinks=True):
        folders.sort()
        if os.path.realpath(place) in entered:
            folders.clear()
            continue
        entered.add(os.path.realpath(place))
        yield from (file for name in sorted(names) if (file := Path(place, name)).is_file())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:24]
