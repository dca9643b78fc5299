"""NAME.jsonl, the journal of a run: the content of NAME.json before that file exists.

Each line is a JSON object. An object with `stamp_ns` is a frame; any other holds entries of the
summary, which replace earlier entries.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from markerless_tracker.errors import DatasetError
from markerless_tracker.results.appended import AppendedFile, not_written

FRAME_KEY = "stamp_ns"
_FRAME = f'{{"{FRAME_KEY}": '
_FRAMES = ' "frames": [\n'
_END = "\n}"
_LONGEST_HEAD = 10_000_000
# The range of int64.
_EARLIEST_NS, _LATEST_NS = -(2**63), 2**63 - 1


class Journal:
    """Writes a journal, then the summary from it; memory does not grow with the frames.

    Args:
        path: the journal.

    Raises:
        DatasetError: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._file = AppendedFile(path)

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._file.size

    def add(self, entries: Mapping[str, Any]) -> None:
        """Append a line, all of it or nothing.

        Args:
            entries: of a frame, `stamp_ns` first, or of the summary.

        Raises:
            DatasetError: it cannot be written.
        """
        self._file.append((json.dumps(entries) + "\n").encode())

    def cut(self, size: int) -> None:
        """Truncate the journal to a size."""
        self._file.cut(size)

    def compose(self, path: Path) -> None:
        """Write the summary and remove the journal.

        Raises:
            DatasetError: the summary cannot be written; the journal stays.
        """
        self._file.close()
        summary = path.with_name(path.name + ".tmp")
        try:
            with summary.open("w", encoding="utf-8", newline="\n") as sink:
                head = json.dumps(_head(self._file.path), indent=1)
                sink.write(f"{head.removesuffix(_END)},\n{_FRAMES}")
                separator = ""
                for line in _lines(self._file.path):
                    if line.startswith(_FRAME):
                        sink.write(f"{separator}  {line}")
                        separator = ",\n"
                sink.write("\n ]\n}\n")
            os.replace(summary, path)
            self._file.path.unlink()
        except OSError as error:
            raise not_written(path, error) from error
        finally:
            summary.unlink(missing_ok=True)


def read_summary(name: Path) -> dict[str, Any]:
    """The content of NAME.json, or of NAME.jsonl if the run did not end: settings, `frames`, etc.

    Args:
        name: path of the result without suffix.

    Raises:
        DatasetError: there is neither, or it is no result.
    """
    head, frames = open_summary(name)
    return {**head, "frames": list(frames)}


def open_summary(name: Path) -> tuple[dict[str, Any], Iterator[dict[str, Any]]]:
    """The entries of a result except its frames, and the frames one after the other.

    Memory does not grow with the frames, unless another program has changed the layout of
    NAME.json.

    Args:
        name: path of the result without suffix.

    Raises:
        DatasetError: there is neither NAME.json nor NAME.jsonl, or it is no result; or, raised by
            the iterator, a frame has no stamp or one outside int64.
    """
    path = name.with_name(name.name + ".json")
    journal = name.with_name(name.name + ".jsonl")
    if journal.exists() and not path.exists():
        with _no_result(journal):
            return _head(journal), _parsed(journal, _lines(journal), _FRAME)
    with _no_result(path):
        head = _composed_head(path)
        if head is not None:
            return head, _parsed(path, _whole(path), f"  {_FRAME}")
        content = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(content, dict) or not isinstance(content.get("frames"), list):
        raise DatasetError(f"{path}: no result of a tracker (it has no `frames`)")
    return content, _checked(path, content.pop("frames"))


@contextmanager
def _no_result(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError, RecursionError) as error:
        raise DatasetError(f"{path}: no result of a tracker ({error})") from error


def _parsed(path: Path, lines: Iterator[str], start: str) -> Iterator[dict[str, Any]]:
    with _no_result(path):
        frames = (json.loads(line.rstrip(",")) for line in lines if line.startswith(start))
        yield from _checked(path, frames)


def _checked(path: Path, frames: Iterable[Any]) -> Iterator[dict[str, Any]]:
    for number, frame in enumerate(frames):
        if not isinstance(frame, dict) or not isinstance(frame.get(FRAME_KEY), int):
            raise DatasetError(
                f"{path}: frame {number}: no `{FRAME_KEY}`, expected whole nanoseconds"
            )
        if not _EARLIEST_NS <= frame[FRAME_KEY] <= _LATEST_NS:
            raise DatasetError(
                f"{path}: frame {number}: `{FRAME_KEY}` is {frame[FRAME_KEY]}, expected "
                f"{_EARLIEST_NS} to {_LATEST_NS}"
            )
        yield frame


def _composed_head(path: Path) -> dict[str, Any] | None:
    """The entries before the frames of a file as `Journal.compose` writes it, None of another."""
    text = ""
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            if line == _FRAMES:
                break
            text += line
            if len(text) > _LONGEST_HEAD:
                return None
        else:
            return None
        first = next(lines, "")
    if not first.startswith((f"  {_FRAME}", " ]")):
        return None
    try:
        head = json.loads(text.rstrip().removesuffix(",") + "}")
    except (ValueError, RecursionError):
        return None
    return head if isinstance(head, dict) else None


def _head(path: Path) -> dict[str, Any]:
    head: dict[str, Any] = {}
    for line in _lines(path):
        if not line.startswith(_FRAME):
            entries = json.loads(line)
            if not isinstance(entries, dict):
                raise ValueError(f"a line is {line[:40]!r}, expected a JSON object")
            head.update(entries)
    return head


def _whole(path: Path) -> Iterator[str]:
    """The lines of a file as `Journal.compose` writes it.

    Raises:
        ValueError: its end is missing.
    """
    line = ""
    for line in _lines(path):
        yield line
    if line != "}":
        raise ValueError("the file is cut off, expected all of it")


def _lines(path: Path) -> Iterator[str]:
    """The complete lines: the end of the process may have cut the last one."""
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            if line.endswith("\n"):
                yield line.rstrip("\n")
