"""A file that grows by whole records while other processes may read it."""

import os
from pathlib import Path

from markerless_tracker.errors import DatasetError


class AppendedFile:
    """A new file; every record reaches the operating system before `append` returns.

    So a sudden end of the process loses no record. Nothing is kept in memory.

    Args:
        path: the file; an earlier one is replaced.

    Raises:
        DatasetError: the file cannot be written; names it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            # Unbuffered: one record, one system call.
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise not_written(path, error) from error
        self.size = 0

    def append(self, record: bytes) -> None:
        """Add a record at the end: all of it or, if there is no room, nothing.

        Raises:
            DatasetError: the record cannot be written; the file holds what it held before.
        """
        try:
            self._write(record)
        except OSError as error:
            self.cut(self.size)
            raise not_written(self.path, error) from error
        self.size += len(record)

    def rewrite(self, offset: int, record: bytes) -> None:
        """Replace bytes at an offset with a record.

        Raises:
            DatasetError: they cannot be written.
        """
        try:
            self._file.seek(offset)
            self._write(record)
            self._file.seek(self.size)
        except OSError as error:
            raise not_written(self.path, error) from error

    def cut(self, size: int) -> None:
        """Truncate the file to a size."""
        self._file.seek(size)
        self._file.truncate()
        self.size = size

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _write(self, record: bytes) -> None:
        rest = memoryview(record)
        while rest:
            rest = rest[self._file.write(rest) :]


def not_written(path: Path, error: OSError) -> DatasetError:
    """The error of a file that cannot be written, in one line."""
    return DatasetError(f"{path}: cannot be written: {error.strerror or error}")


def check_writable(path: Path) -> None:
    """Check that a file can be written, without changing its content.

    Raises:
        DatasetError: it cannot be written.
    """
    try:
        exists = path.exists()
        with path.open("ab"):
            pass
        if not exists:
            os.unlink(path)
    except OSError as error:
        raise not_written(path, error) from error


def make_folder_of(path: Path) -> None:
    """Make the folder of a file, and check that the file can be written there.

    Raises:
        DatasetError: it cannot.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path, error) from error
    check_writable(path)
