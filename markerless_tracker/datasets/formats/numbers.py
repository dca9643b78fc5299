"""Text files of numbers and JSON, and the sizes of the images that they belong to."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.datasets.video.images import open_stream
from markerless_tracker.errors import CalibrationError, DatasetError
from markerless_tracker.geometry import FloatArray


def read_numbers(path: Path, field: str, *counts: int) -> FloatArray:
    """The numbers of a text file, separated by white space or commas.

    Args:
        path: the file.
        field: what the numbers are, for messages.
        counts: how many there may be.

    Raises:
        DatasetError: the file cannot be read, or has other content; names file and field.
    """
    expected = " or ".join(map(str, counts))
    try:
        words = path.read_text(encoding="ascii").replace(",", " ").split()
        values = np.array([float(word) for word in words])
    except OSError as error:
        raise DatasetError(f"{path}: {field} cannot be read: {error.strerror}") from error
    except ValueError as error:
        reason = "not a text file" if isinstance(error, UnicodeDecodeError) else str(error)
        raise DatasetError(f"{path}: {field}: {reason}, expected {expected} numbers") from error
    if values.size not in counts or not np.isfinite(values).all():
        raise DatasetError(
            f"{path}: {field} has {values.size} numbers, expected {expected} finite ones"
        )
    return values


def read_json(path: Path) -> dict[str, Any]:
    """The object of a JSON file.

    Raises:
        DatasetError: the file cannot be read, or holds something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise DatasetError(f"{path}: not a JSON file: {error}") from error
    if not isinstance(content, dict):
        raise DatasetError(f"{path}: holds a {type(content).__name__}, expected an object")
    return content


def array_of(where: str, table: Mapping[str, Any], field: str, shape: Sequence[int]) -> FloatArray:
    """The numbers of a field, in any nesting, as an array of a shape.

    Raises:
        CalibrationError: the field is missing, or holds other numbers; names it.
    """
    expected = " x ".join(map(str, shape))
    if field not in table:
        raise CalibrationError(f"{where}: {field} is missing, expected {expected} numbers")
    try:
        values = np.array(table[field], dtype=np.float64).reshape(shape)
    except (TypeError, ValueError):
        values = np.empty(0)
    if not values.size or not np.isfinite(values).all():
        raise CalibrationError(
            f"{where}: {field} is {table[field]!r}, expected {expected} finite numbers"
        )
    return values


def count_of(table: Mapping[str, Any], field: str) -> int:
    """How many numbers a field has, in any nesting; 0 where it is missing or uneven."""
    try:
        return int(np.size(table.get(field, [])))
    except ValueError:
        return 0


def image_sizes(sources: Mapping[str, Path]) -> dict[str, tuple[int, int]]:
    """Camera -> (width, height) of the images of its video or folder.

    Raises:
        DatasetError: a source cannot be read.
    """
    sizes = {}
    for name, source in sources.items():
        stream = open_stream(source)
        stream.close()
        sizes[name] = stream.size_px
    return sizes
