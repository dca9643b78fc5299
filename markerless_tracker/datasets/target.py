"""Folders that are created complete or not at all."""

import ctypes
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from markerless_tracker.errors import DatasetError

BAG_FILE = "metadata.yaml"
"""The file that every bag folder has."""


@contextmanager
def new_folder(path: str | Path, *, replace: bool = False) -> Iterator[Path]:
    """A folder to fill; it is renamed to `path` when the block ends without an exception.

    Until then it is in a hidden `.NAME.partial-*` next to it, which is removed on any exception,
    Ctrl-C included, or after a kill by the next call with that path. An empty folder at `path` is
    replaced. At every moment an earlier bag or the new one is at `path`, where the system can
    exchange two folders (Linux, on local disks).

    Args:
        path: the folder.
        replace: whether a bag (a folder with `metadata.yaml`) at `path` is replaced, too.

    Raises:
        DatasetError: something is at `path` already, or it cannot be created.
    """
    path = Path(os.path.abspath(path))
    earlier = replace and not path.is_symlink() and (path / BAG_FILE).is_file()
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise DatasetError(f"{path}: exists and is not a folder, expected a new or an empty folder")
    if path.is_dir() and any(path.iterdir()) and not earlier:
        hint = " (--force replaces a bag)" if (path / BAG_FILE).is_file() else ""
        raise DatasetError(
            f"{path}: exists and is not empty, expected a new or an empty folder{hint}"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path)
        prefix = f"{_prefix(path)}{os.getpid()}-"
        holder = Path(tempfile.mkdtemp(prefix=prefix, dir=path.parent))
    except OSError as error:
        raise DatasetError(f"{path}: cannot be created: {error.strerror}") from error
    try:
        # It has its final name inside the holder: some formats name files after their folder.
        inner = holder / path.name
        inner.mkdir()
        yield inner
        if earlier:
            if _exchanged(inner, path):
                return
            _replace(path, inner, holder / f"{path.name}.earlier")
            return
        if path.is_dir():
            path.rmdir()
        inner.rename(path)
    except OSError as error:
        # The block may have read or written files elsewhere.
        other = Path(error.filename or path)
        where = path if holder in (other, *other.parents) else other
        reason = error.strerror or error
        raise DatasetError(f"{where}: cannot be read or written: {reason}") from error
    finally:
        shutil.rmtree(holder, ignore_errors=True)


def _replace(path: Path, new: Path, kept: Path) -> None:
    """Move a new folder to a path, and the folder there to `kept`; back if that fails."""
    try:
        path.rename(kept)
        new.rename(path)
    except BaseException:
        if kept.is_dir() and not path.exists():
            kept.rename(path)
        raise


def _prefix(path: Path) -> str:
    """Start of the names of folders that this machine fills for a path; their process follows."""
    return f".{path.name}.partial-{socket.gethostname()}-"


def _sweep(path: Path) -> None:
    """Remove what killed processes of this machine left beside a path."""
    for folder in path.parent.iterdir():
        if not folder.name.startswith(_prefix(path)):
            continue
        match = re.match(r"(\d+)-", folder.name.removeprefix(_prefix(path)))
        if match and not os.path.exists(f"/proc/{match[1]}") and os.path.isdir("/proc/self"):
            left = folder / f"{path.name}.earlier"
            if left.is_dir() and not path.exists():
                left.rename(path)
            shutil.rmtree(folder, ignore_errors=True)


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two folders at once; False where the system cannot."""
    try:
        exchange = ctypes.CDLL(None).renameat2
    except (OSError, AttributeError):
        return False
    here, both = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    return bool(exchange(here, os.fsencode(one), here, os.fsencode(other), both) == 0)
