"""Which limbs are searched in rotation, though nothing suggests that they are wrong."""

from collections.abc import Sequence

PER_LIMB_NS = 40_000_000
"""Time between two frames after which one limb is searched."""
PUT_OFF = 2.0
"""While frames have other searches, a limb is searched only when so many limbs are due: at
60 frames/s after 0.2 instead of 0.1 s."""


class RoundRobin:
    """Names the limbs to search, one after the other.

    The pose of a frame is predicted from the motion so far. How far a limb's acceleration takes it
    from there grows with the square of the time between frames, and the refinement loses limbs
    that are far. So the number of limbs in a frame is (time / `PER_LIMB_NS`)²: one in every sixth
    frame at 60 frames/s, two in three frames at 30, all four at 12.
    """

    def __init__(self) -> None:
        self._next = 0
        self._due = 1.0

    def advance(self, since_ns: int) -> None:
        """Note a frame, and the time since the one before it, ns; 0 for the first one."""
        self._due += (since_ns / PER_LIMB_NS) ** 2

    def take(
        self, limbs: Sequence[str], *, put_off: bool = False, single: bool = False
    ) -> list[str]:
        """The limbs that are due in a frame, after `advance`; those of a frame in which it is not
        called are due later.

        Args:
            limbs: names of all limbs, in the same order in every call.
            put_off: whether limbs that can wait are put off; then one limb at most is due.
            single: whether there is time for one limb at most.
        """
        if self._due < (PUT_OFF if put_off else 1.0):
            return []
        count = 1 if put_off or single else min(int(self._due), len(limbs))
        self._due %= 1.0
        names = [limbs[(self._next + i) % len(limbs)] for i in range(count)]
        self._next += count
        return names
