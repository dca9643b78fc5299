"""Where a result is written: its files, and whether they may be."""

from pathlib import Path

from markerless_tracker.errors import DatasetError
from markerless_tracker.results.appended import make_folder_of

SUBJECT = ".subject.yaml"
"""Suffix of the file with the sizes of the tracked body."""
_SUFFIXES = (".trc", ".json", ".jsonl")
_HEADER_LINES = 5


def result_name(text: str) -> Path:
    """The NAME of a result's files from what a user gave: NAME, or the path of one of its files.

    Raises:
        DatasetError: it names a folder, or nothing.
    """
    path = Path(text)
    if path.name in ("", "..") or text.endswith("/"):
        raise DatasetError(f"{text!r} names no file, expected a name such as {path / 'walk'}")
    return path.with_suffix("") if path.suffix.lower() in _SUFFIXES else path


def earlier_files(name: Path) -> list[Path]:
    """Files of an earlier result of that name, without NAME.subject.yaml."""
    paths = (path_of(name, suffix) for suffix in _SUFFIXES)
    return [path for path in paths if path.exists()]


def check_target(name: Path, *, overwrite: bool, allow: str = "`overwrite`") -> None:
    """Make sure that a result can be written, without changing an earlier one; makes the folder.

    Args:
        name: path of the result without suffix.
        overwrite: whether an earlier result may be replaced.
        allow: what allows it, for the message.

    Raises:
        DatasetError: it cannot, or there is an earlier result with frames or a subject file, and
            `overwrite` is not set.
    """
    earlier = [] if _without_frames(path_of(name, ".trc")) else earlier_files(name)
    if (subject := path_of(name, SUBJECT)).exists():
        earlier.append(subject)
    if earlier and not overwrite:
        raise DatasetError(f"{earlier[0]}: exists already, expected a new name or {allow}")
    for suffix in _SUFFIXES:
        make_folder_of(path_of(name, suffix))


def is_result(name: Path) -> bool:
    """Whether there is a result of that name, finished or not."""
    return path_of(name, ".json").exists() or path_of(name, ".jsonl").exists()


def segments(name: Path) -> list[Path]:
    """The further marker files NAME.2.trc, NAME.3.trc, ... of a result.

    Those of other results, which have a summary of their own, are left out.
    """
    found, number = [], 2
    while (path := path_of(name, f".{number}.trc")).exists():
        if not is_result(path.with_suffix("")):
            found.append(path)
        number += 1
    return found


def _without_frames(path: Path) -> bool:
    """Whether a marker file has a header and no rows: its run ended before the first frame."""
    try:
        with path.open("rb") as file:
            lines = [line.strip() for line, _ in zip(file, range(_HEADER_LINES + 2), strict=False)]
    except OSError:
        return False
    return len(lines) >= _HEADER_LINES and not any(lines[_HEADER_LINES:])


def path_of(name: Path, suffix: str) -> Path:
    """A file of the result `name`; names may hold dots."""
    return name.with_name(name.name + suffix)
