"""Folders that are created complete or not at all."""

import os
import shutil
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
    Ctrl-C included. An empty folder at `path` is replaced.

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
        holder = Path(tempfile.mkdtemp(prefix=f".{path.name}.partial-", dir=path.parent))
    except OSError as error:
        raise DatasetError(f"{path}: cannot be created: {error.strerror}") from error
    try:
        # It has its final name inside the holder: some formats name files after their folder.
        inner = holder / path.name
        inner.mkdir()
        yield inner
        if earlier:
            path.rename(holder / f"{path.name}.earlier")
        elif path.is_dir():
            path.rmdir()
        inner.rename(path)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(holder, ignore_errors=True)
