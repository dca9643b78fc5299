"""Warnings of single frames: each kind is printed once, all are counted."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

_NUMBER = re.compile(r"(?<!\w)[+-]?\d+(\.\d+)?(?!\w)")


@dataclass
class WarningKind:
    """Warnings whose texts differ at most in their numbers.

    Attributes:
        text: the first of them.
        first_frame: number of its frame in the recording.
        frames: number of frames with such a warning.
    """

    text: str
    first_frame: int
    frames: int = 0


@dataclass
class FrameWarnings:
    """The kinds of warning in a run, in the order of their first frames.

    Attributes:
        kinds: text without its numbers -> kind.
        frames: number of frames with any warning.
    """

    kinds: dict[str, WarningKind] = field(default_factory=dict)
    frames: int = 0

    def add(self, frame: int, texts: Iterable[str]) -> list[WarningKind]:
        """Count the warnings of one frame; returns the new kinds.

        Args:
            frame: number of the frame in the recording.
            texts: one line each.
        """
        found: dict[str, str] = {}
        for text in texts:
            found.setdefault(_key(text), text)
        new = []
        for key, text in found.items():
            if key not in self.kinds:
                self.kinds[key] = WarningKind(text, frame)
                new.append(self.kinds[key])
            self.kinds[key].frames += 1
        self.frames += bool(found)
        return new

    def as_list(self) -> list[dict[str, Any]]:
        """The kinds for JSON."""
        return [
            {"text": kind.text, "first_frame": kind.first_frame, "frames": kind.frames}
            for kind in self.kinds.values()
        ]


def _key(text: str) -> str:
    """A text without its numbers; the camera's or limb's name before the first colon stays."""
    name, colon, rest = text.partition(":")
    return name + colon + _NUMBER.sub("#", rest) if colon else _NUMBER.sub("#", text)
