"""Text files of numbers, and the sizes of the images that they belong to."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from markerless_tracker.datasets.video.images import open_stream
from markerless_tracker.errors import DatasetError
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
