"""Log lines with limited frequency: repetitions are counted."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock

HOLD_S = 10.0
"""Repetitions of a line within this time are counted instead of logged."""

_VARIABLE = re.compile(r"'[^']*'|\"[^\"]*\"|(?<![\w.])[+-]?\d[\d.]*(?:x\d+)?%?(?!\w)")
_LONGEST = 500
_KINDS_MAX = 200


def kind_of(text: str) -> str:
    """The text without its numbers and quoted words: lines of one kind share it."""
    return _VARIABLE.sub("#", text)


@dataclass
class _Kind:
    text: str
    logged_s: float
    held: int = 0


class Notices:
    """Logs the first line of a kind at once and counts further ones (see `kind_of`).

    Safe to use from several threads.

    Args:
        log: called with the lines.
        clock: monotonic time in s.
    """

    def __init__(self, log: Callable[[str], None], clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._lock = Lock()
        self._kinds: dict[str, _Kind] = {}

    def say(self, text: str) -> bool:
        """Log a line, unless one of its kind was logged less than `HOLD_S` ago.

        Returns:
            Whether it was logged now; else `flush` logs the number of repetitions.
        """
        text = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
        key = kind_of(text)
        with self._lock:
            self._drop_old()
            known = self._kinds.get(key)
            if known is None and len(self._kinds) >= _KINDS_MAX:
                key = "others"
                known = self._kinds.get(key)
            if known is not None:
                known.text, known.held = text, known.held + 1
                return False
            self._kinds[key] = _Kind(text, self._clock())
        self._log(text)
        return True

    def flush(self, *, last: bool = False) -> None:
        """Log repetitions counted for `HOLD_S`; to be called periodically.

        Args:
            last: whether to log all of them, since no further call follows.
        """
        lines = []
        with self._lock:
            now_s = self._clock()
            for kind in self._kinds.values():
                since_s = now_s - kind.logged_s
                if kind.held and (last or since_s >= HOLD_S):
                    seconds = since_s if last else HOLD_S
                    lines.append(f"{kind.text} ({kind.held} times in {seconds:.2g} s)")
                    kind.held, kind.logged_s = 0, now_s
            self._drop_old()
        for line in lines:
            self._log(line)

    def _drop_old(self) -> None:
        now_s = self._clock()
        self._kinds = {
            key: kind
            for key, kind in self._kinds.items()
            if kind.held or now_s - kind.logged_s < HOLD_S
        }
