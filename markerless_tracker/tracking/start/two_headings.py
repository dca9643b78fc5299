"""Decides which of two opposite headings a person has: both give nearly the same silhouettes.

Both are tracked for some frames. The heading that explains them better is kept; a walking person
faces the walking direction.
"""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body.anatomy import heading_difference
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray

SETTLING_FRAMES, MOST_FRAMES = 8, 12
"""Frames of the start, after which the person is tracked; and most frames, while the latest frame
and the mean favour different headings: the poses of one heading still improve."""
SIZED_FROM = 2
"""Index of the first frame in which the headings are compared. The frames before it had a body of
another size, and their search favoured the heading that leads."""
COMPARED = 4
"""Number of the latest frames whose costs are compared: poses improve over the frames."""
_MARGIN = 0.01
"""Mean gain that the opposite heading needs before the settling ends. At its end any gain is
enough: of 139 starts in postures, 138 had the lower mean cost with the right heading (137 by f_s
alone)."""
_WALKED_M, _WALK_M_S, _WALK_BONUS = 0.05, 0.25, 0.01
"""People walk forwards. Beyond this distance and speed, the cost of the heading along the walking
direction is lower by this bonus."""

_TURNED_RAD = 0.5
"""A leading pose that is turned farther than this shows that the person has turned."""


@dataclass(frozen=True, eq=False)
class HeadingFit:
    """The best pose of one heading in one frame.

    Attributes:
        contours: the frame's contour evidence.
        pose: (p,).
        cost: `OwnEvidence.cost_with_prior`: 1 - f_s, and how unusual the limbs are.
        trunk_m: (3,) middle of the trunk, world frame.
    """

    contours: ContourFrame
    pose: FloatArray
    cost: float
    trunk_m: FloatArray


class TwoHeadings:
    """The leading heading and the opposite one, over the frames of a start.

    Args:
        heading_rad: the heading found first.
    """

    def __init__(self, heading_rad: float) -> None:
        self._first_rad = heading_rad
        self._leading = 0
        self._counted_from = SIZED_FROM
        self._fits: list[tuple[HeadingFit | None, HeadingFit | None]] = []
        self._stamps_ns: list[int] = []

    def __len__(self) -> int:
        """Number of frames so far."""
        return len(self._fits)

    @property
    def over(self) -> bool:
        """Whether all frames of the start have been taken."""
        gains = self._gains
        changing = bool(gains) and (gains[-1] > 0.0) != (float(np.mean(gains)) > 0.0)
        return len(self) >= (MOST_FRAMES if changing else SETTLING_FRAMES)

    @property
    def leading_rad(self) -> float:
        """The leading heading."""
        return self.both_rad[self._leading]

    @property
    def both_rad(self) -> tuple[float, float]:
        """The heading found first and the opposite one."""
        return self._first_rad, self._first_rad + np.pi

    @property
    def leading_fits(self) -> list[HeadingFit]:
        """The fits of the leading heading, in the frames in which it had a pose."""
        return [fit for fits in self._fits if (fit := fits[self._leading]) is not None]

    def restart(self) -> None:
        """Exclude the next frame and those before it from the comparison; only in the first frames.

        To be called in the first frame after a gap in time: both headings are far from the person
        in it, and which of them is found again is chance.
        """
        if len(self) <= SIZED_FROM:
            self._counted_from = max(SIZED_FROM, len(self) + 1)

    def note(self, stamp_ns: int, fits: tuple[HeadingFit | None, HeadingFit | None]) -> None:
        """Take a frame.

        Args:
            stamp_ns: its time.
            fits: of the headings of `both_rad`; None for a heading that no pose has.
        """
        self._fits.append(fits)
        self._stamps_ns.append(stamp_ns)

    def follow(self, heading_rad: float) -> None:
        """Take the heading of the leading pose for that of the person, who turns.

        In frames that follow soon it is the same within what poses differ by.
        """
        if heading_difference(heading_rad, self.leading_rad) > _TURNED_RAD:
            self._first_rad = heading_rad - self._leading * np.pi

    def change(self) -> bool:
        """Let the opposite heading lead if it explains the frames better.

        Returns:
            Whether it leads from now on.
        """
        other = 1 - self._leading
        last = self._fits[self._counted_from :][-1:]
        if not last or last[0][other] is None:
            return False
        gains = self._gains
        rise = float(np.mean(gains)) if gains and last[0][self._leading] else 1.0
        rise += 2.0 * _WALK_BONUS * self._walks_along(self.both_rad[other])
        if rise <= (0.0 if self.over else _MARGIN):
            return False
        self._leading = other
        return True

    @property
    def _gains(self) -> list[float]:
        """What the opposite heading gains over the leading one, in each of the latest frames."""
        pairs = [(f[self._leading], f[1 - self._leading]) for f in self._fits[self._counted_from :]]
        return [a.cost - b.cost for a, b in pairs[-COMPARED:] if a and b]

    def _walks_along(self, heading_rad: float) -> float:
        """Cosine of the angle from a heading to the walking direction; 0 for a standing person."""
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
