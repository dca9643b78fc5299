"""What a check found: green, yellow or red, and what to do."""

from dataclasses import dataclass

GREEN, YELLOW, RED = "green", "yellow", "red"


@dataclass(frozen=True)
class Finding:
    """One line of a check.

    Attributes:
        check: name of the check.
        state: green, yellow (may be right) or red (will be wrong).
        camera: the camera, empty if it concerns all.
        text: what was found, with numbers.
        advice: what to do; empty for green.
    """

    check: str
    state: str
    camera: str
    text: str
    advice: str = ""
