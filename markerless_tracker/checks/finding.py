"""The finding of a check: green, yellow or red, and advice."""

from dataclasses import dataclass

GREEN, YELLOW, RED = "green", "yellow", "red"


@dataclass(frozen=True)
class Finding:
    """One line of a check.

    Attributes:
        check: name of the check.
        state: green, yellow (doubtful) or red (wrong).
        camera: the camera; empty if the finding concerns all.
        text: what was found, with numbers.
        advice: what to do; empty for green.
    """

    check: str
    state: str
    camera: str
    text: str
    advice: str = ""


def grade(value: float, limits: tuple[float, float]) -> str:
    """Green below the first limit, yellow below the second, else red."""
    return GREEN if value < limits[0] else YELLOW if value < limits[1] else RED


def worse(one: str, other: str) -> str:
    """The worse of two states."""
    return max(one, other, key=(GREEN, YELLOW, RED).index)
