"""Reference markers of a recording: `ground_truth.trc` in its folder."""

from pathlib import Path

from markerless_tracker.errors import DatasetError

TRUTH = "ground_truth.trc"
"""Name of the marker file with the reference markers."""


def truth_path(source: Path) -> Path:
    """Path of a recording's reference markers, whether the file exists or not.

    Args:
        source: the recording's folder, or a `.mcap` file in it.
    """
    return (source if source.is_dir() else source.parent) / TRUTH


def existing_truth(source: Path) -> Path:
    """Path of a recording's reference markers; `source` as in `truth_path`.

    Raises:
        DatasetError: the recording has none.
    """
    path = truth_path(source)
    if not path.is_file():
        raise DatasetError(f"{source}: no {TRUTH}, expected one as the reference")
    return path
