"""Which of two opposite headings a person has: both give nearly the same silhouettes.

Both are tracked for some frames. The one that explains them better is kept, and a person who walks
faces the way that the trunk moves.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body.anatomy import heading_difference
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray

SETTLING_FRAMES = 8
"""Frames from the first pose to the one from which on it is tracked like any other."""
SIZED_FROM = 2
"""Number of the frame, from 0, from which on both headings count: the frames before it were
searched for what came to lead, with a body of another size."""
COMPARED = 4
"""Latest frames whose f_s are compared: poses still improve."""
_MARGIN, _LAST_MARGIN = 0.01, 0.003
"""Mean rise of f_s that the opposite heading needs before the settling ends, and at its end."""
_WALKED_M, _WALK_M_S, _WALK_BONUS = 0.05, 0.25, 0.01
"""People walk forwards: added to f_s beyond that distance and speed."""


@dataclass(frozen=True, eq=False)
class HeadingFit:
    """The best pose of one heading in one frame.

    Attributes:
        contours: the frame's contour evidence.
        pose: (p,).
        cost: 1 - f_s, in evidence that the pose itself decides.
        trunk_m: (3,) middle of the trunk, world frame.
    """

    contours: ContourFrame
    pose: FloatArray
    cost: float
    trunk_m: FloatArray


class TwoHeadings:
    """A heading that leads and the opposite one, over the frames of a start.

    Args:
        heading_rad: the heading found first.
    """

    def __init__(self, heading_rad: float) -> None:
        self._first_rad = heading_rad
        self._leading = 0
        self._changed = False
        self._counted_from = SIZED_FROM
        self._fits: list[tuple[HeadingFit | None, HeadingFit | None]] = []
        self._stamps_ns: list[int] = []

    def __len__(self) -> int:
        """Number of frames so far."""
        return len(self._fits)

    @property
    def over(self) -> bool:
        """Whether there were as many frames as the settling takes."""
        return len(self) >= SETTLING_FRAMES

    @property
    def leading_rad(self) -> float:
        """The heading that leads."""
        return self.both_rad[self._leading]

    @property
    def both_rad(self) -> tuple[float, float]:
        """The heading found first and the opposite one."""
        return self._first_rad, self._first_rad + np.pi

    @property
    def leading_fits(self) -> list[HeadingFit]:
        """Of the heading that leads, in the frames in which it had a pose."""
        return [fit for fits in self._fits if (fit := fits[self._leading]) is not None]

    def restart(self) -> None:
        """Let the next frame not count, nor those before it; only among the first frames.

        To be called after a gap in time: in that frame both headings are far from the person, and
        which of the two is found again there is chance.
        """
        if len(self) <= SIZED_FROM:
            self._counted_from = max(SIZED_FROM, len(self) + 1)

    def note(self, stamp_ns: int, fits: tuple[HeadingFit | None, HeadingFit | None]) -> None:
        """Take a frame.

        Args:
            stamp_ns: its time.
            fits: of the headings of `both_rad`; None where no pose has it.
        """
        self._fits.append(fits)
        self._stamps_ns.append(stamp_ns)

    def change(self) -> bool:
        """Let the opposite heading lead if it explains the frames better; at most once.

        Returns:
            Whether it leads from now on.
        """
        lead, other = self._leading, 1 - self._leading
        pairs = [(fits[lead], fits[other]) for fits in self._fits[self._counted_from :]]
        if self._changed or not pairs or pairs[-1][1] is None:
            return False
        gains = [a.cost - b.cost for a, b in pairs[-COMPARED:] if a and b]
        rise = float(np.mean(gains)) if gains and pairs[-1][0] else 1.0
        rise += 2.0 * _WALK_BONUS * self._walks_along(self.both_rad[other])
        if rise <= (_LAST_MARGIN if self.over else _MARGIN):
            return False
        self._leading, self._changed = other, True
        return True

    def _walks_along(self, heading_rad: float) -> float:
        """Cosine of the angle from a heading to the way that the person walks; 0 if none does."""
        first, last = self._fits[self._counted_from], self._fits[-1]
        moves = [b.trunk_m - a.trunk_m for a, b in zip(first, last, strict=True) if a and b]
        seconds = (self._stamps_ns[-1] - self._stamps_ns[self._counted_from]) * 1e-9
        if not moves or seconds <= 0.0:
            return 0.0
        along, across = np.mean(moves, axis=0)[:2]
        walked_m = float(np.hypot(along, across))
        if walked_m <= _WALKED_M or walked_m / seconds <= _WALK_M_S:
            return 0.0
        return float(np.cos(heading_difference(float(np.arctan2(across, along)), heading_rad)))
