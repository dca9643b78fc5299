"""Where a result is written: its files, and whether they may be."""

from pathlib import Path

from markerless_tracker.errors import DatasetError
from markerless_tracker.results.appended import make_folder_of

_SUFFIXES = (".trc", ".json", ".jsonl")


def earlier_files(name: Path) -> list[Path]:
    """Files of an earlier result of that name."""
    paths = (path_of(name, suffix) for suffix in _SUFFIXES)
    return [path for path in paths if path.exists()]


def check_target(name: Path, *, overwrite: bool, allow: str = "`overwrite`") -> None:
    """Make sure that a result can be written, without changing an earlier one; makes the folder.

    Args:
        name: path of the result without suffix.
        overwrite: whether an earlier result may be replaced.
        allow: what allows it, for the message.

    Raises:
        DatasetError: it cannot, or there is an earlier result and `overwrite` is not set.
    """
    earlier = earlier_files(name)
    if earlier and not overwrite:
        raise DatasetError(f"{earlier[0]}: exists already, expected a new name or {allow}")
    for suffix in _SUFFIXES:
        make_folder_of(path_of(name, suffix))


def path_of(name: Path, suffix: str) -> Path:
    """A file of the result `name`; names may hold dots."""
    return name.with_name(name.name + suffix)
