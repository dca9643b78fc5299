"""How a player lets its node's callbacks run."""

from collections.abc import Callable
from typing import Protocol


def never() -> bool:
    """No condition."""
    return False


class Spin(Protocol):
    """Lets the node's callbacks run."""

    def __call__(self, seconds: float, until: Callable[[], bool] = never) -> bool:
        """Let callbacks run for some seconds (0: only those due), or until a condition holds.

        Returns:
            Whether to continue; False when it is time to end.
        """
