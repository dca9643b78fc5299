"""What a run's numbers depend on, as one short key: an interrupted table goes on where it was."""

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from markerless_tracker.resources import config_dir
from markerless_tracker.results.result import versions

_PACKAGE = Path(__file__).resolve().parent.parent


def run_key(parts: Mapping[str, Any]) -> str:
    """Key of a run: of what is named (JSON values), the versions, the code and shipped bodies."""
    whole = {"versions": versions(), "code": code_key(), **parts}
    return _digest(json.dumps(whole, sort_keys=True).encode())


def recording_key(path: Path) -> str:
    """Key of a recording: names, sizes and times of its files; copying it makes another."""
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    told = []
    for file in files:
        status = file.stat()
        told.append([file.relative_to(path.parent).as_posix(), status.st_size, status.st_mtime_ns])
    return _digest(json.dumps(told).encode())


def file_key(path: Path) -> str:
    """Key of a file's content; of its name where there is no such file."""
    return _digest(path.read_bytes() if path.is_file() else str(path).encode())


@cache
def code_key() -> str:
    """Key of the package's source and of the bodies it ships."""
    files = sorted(_PACKAGE.rglob("*.py")) + sorted((config_dir() / "bodies").glob("*.yaml"))
    return _digest(b"\0".join(file.read_bytes() for file in files))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:24]
