"""Atomic writing of files, and the format of the numbers in them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from markerless_tracker.results.appended import not_written


@contextmanager
def new_file(path: Path, *, binary: bool = False) -> Iterator[IO[Any]]:
    """A file to write; it replaces `path` when the block ends without an exception.

    Raises:
        DatasetError: it cannot be written.
    """
    partial = path.with_name(path.name + ".tmp")
    try:
        with (
            partial.open("wb") if binary else partial.open("w", encoding="utf-8", newline="\n")
        ) as sink:
            yield sink
        os.replace(partial, path)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def number(value: float, digits: int) -> str:
    """A number with a given number of decimals, without a negative zero; empty for NaN."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}" if value == value else ""
