"""The recordings in a folder or a list, and a name for each."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from markerless_tracker.datasets import detect_format
from markerless_tracker.datasets.source import trials_at
from markerless_tracker.errors import DatasetError


def find_recordings(source: Path, *, without: Path | None = None) -> dict[str, Path]:
    """Name -> absolute path of every recording, in order of the names (of the lines of a list).

    A folder is searched recursively, except hidden folders and the content of recordings. Each
    trial in a data set's folder is a recording. A list is a text file with one path per line,
    relative to the list's folder. Blank lines, lines that begin with # and repeated paths are left
    out; the other paths are recordings, whether they exist or not. A name is the path relative to
    the folder (to the longest common folder of a list), without the suffix of a file.

    Args:
        source: the folder or list.
        without: a folder that is not searched, such as that of the results; not the source itself.

    Raises:
        DatasetError: there is no such folder or list, or no recording in it.
    """
    if source.is_dir():
        base = Path(os.path.abspath(source))
        left_out = set() if without is None else {os.path.realpath(without)}
        found = sorted(_below(base, left_out - {os.path.realpath(base)}))
        base = base.parent if found == [base] else base
    elif source.suffix == ".mcap" and source.is_file():
        found = [Path(os.path.abspath(source))]
        base = found[0].parent
    else:
        found = _listed(source)
        base = Path(os.path.commonpath([path.parent for path in found])) if found else Path()
    if not found:
        raise DatasetError(f"{source}: no recording, expected some in this folder or list")
    return _named(found, base)


def _below(folder: Path, seen: set[str]) -> Iterator[Path]:
    """The recordings at and below a folder; folders repeated by links count once."""
    real = os.path.realpath(folder)
    if real in seen:
        return
    seen.add(real)
    loose = sorted(folder.glob("*.mcap"))
    if len(loose) > 1 and not (folder / "metadata.yaml").is_file():
        # Without a description the files belong to different recordings.
        yield from loose
    elif detect_format(folder) is not None:
        yield from trials_at(folder)
        return
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be read: {error.strerror}") from error
    for entry in entries:
        if entry.is_dir() and not entry.name.startswith("."):
            yield from _below(entry, seen)


def _listed(path: Path) -> list[Path]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise DatasetError(
            f"{path}: {reason}, expected a folder or a list of recordings"
        ) from error
    words = (line.strip() for line in lines)
    paths = [
        Path(os.path.abspath(path.parent / Path(word).expanduser()))
        for word in words
        if word and not word.startswith("#")
    ]
    return list(dict.fromkeys(paths))


def _named(paths: Sequence[Path], base: Path) -> dict[str, Path]:
    names: dict[str, Path] = {}
    for path in paths:
        whole = path.relative_to(base).as_posix()
        short = whole.removesuffix(path.suffix) if path.is_file() else whole
        names[whole if short in names else short] = path
    return names
