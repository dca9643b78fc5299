"""Which searches for limbs and headings a frame gets."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.limbs.exchange import Exchange, PairExchange
from markerless_tracker.tracking.limbs.facing import FacingWatch
from markerless_tracker.tracking.limbs.round_robin import RoundRobin
from markerless_tracker.tracking.limbs.walking import WalkingWatch

DENSE_NS = 40_000_000
"""If frames follow each other faster than this, searches that can wait are put off to other frames,
since sets that come too late are lost."""
VERY_DENSE_NS = 25_000_000
"""If frames follow each other faster than this, one suspected limb at most is searched in a frame,
and the search of a limb in rotation takes two frames."""
FIRST_WAIT_NS = 32_000_000
"""Time before a limb near unexplained silhouette is searched again, after one search without gain.
It doubles with each further search without gain, at most `_DOUBLINGS` times."""
_DOUBLINGS = 4
_GROWN = 2.0
"""Earlier searches do not count once the unexplained area has grown by this factor."""


@dataclass(frozen=True)
class Due:
    """The searches of a frame.

    Attributes:
        pair: exchange of both legs or both arms.
        facing: whether to compare another heading.
        walking: poses (p,) that face the walking direction.
        limbs: names of the limbs to search elsewhere.
        begun: names of limbs that are drawn in this frame, and compared in the next one.
    """

    pair: Exchange | None = None
    facing: bool = False
    walking: Sequence[FloatArray] = ()
    limbs: Sequence[str] = ()
    begun: Sequence[str] = ()

    @property
    def whole(self) -> bool:
        """Whether whole poses are compared."""
        return self.facing or self.pair is not None or bool(self.walking)

    def __bool__(self) -> bool:
        return self.whole or bool(self.limbs) or bool(self.begun)


@dataclass(frozen=True)
class _Wait:
    """Searches of a limb without gain.

    Attributes:
        failures: number of such searches in a row.
        searched_ns: time of the last one.
        area_m2: unexplained silhouette at that time.
    """

    failures: int
    searched_ns: int
    area_m2: float

    def over(self, stamp_ns: int, area_m2: float) -> bool:
        """Whether the limb may be searched again at a time, with that unexplained area."""
        since_ns = stamp_ns - self.searched_ns
        grown = area_m2 > _GROWN * self.area_m2
        return grown or not 0 <= since_ns < FIRST_WAIT_NS * 2 ** (self.failures - 1)


class LimbSchedule:
    """Decides which searches are due, and spreads them over the frames.

    Limbs that are due are the lost ones, those near unexplained silhouette, and some in rotation.
    Whole poses (exchanges, headings) are compared at intervals.

    Attributes:
        exchange, facing, walking: the comparisons of whole poses.
    """

    def __init__(self) -> None:
        self.exchange = PairExchange()
        self.facing = FacingWatch()
        self.walking = WalkingWatch()
        self._round_robin = RoundRobin()
        self._frames = 0
        self._rounds = 0
        self._round_of: dict[str, int] = {}
        self._unexplained = 0
        self._last_ns: int | None = None
        self._waits: dict[str, _Wait] = {}

    def take(
        self,
        body: BodyModel,
        pose: FloatArray,
        limits: FloatArray,
        stamp_ns: int,
        *,
        lost: Sequence[str],
        areas_m2: Mapping[str, float],
        badly: bool,
        late: bool,
        single: bool,
        busy: bool,
    ) -> Due:
        """The searches that are due in a frame; they count as done.

        Args:
            body: the body.
            pose: (p,) the estimate.
            limits: (2, p) of poses.
            stamp_ns: time of the frame.
            lost: the lost limbs.
            areas_m2: unexplained silhouette by limb that it may belong to, the likeliest first.
            badly, late, single: as for `LimbWatch.recover`.
            busy: whether a limb drawn in the frame before is compared in this one.
        """
        if not areas_m2:
            self._waits.clear()
        self._frames += 1
        self.walking.note(body, pose, stamp_ns)
        since_ns = 0 if self._last_ns is None else max(0, stamp_ns - self._last_ns)
        dense = self._last_ns is not None and since_ns < DENSE_NS
        self._last_ns = stamp_ns
        self._round_robin.advance(since_ns)
        due = Due()
        if not busy and (not single or self._frames % 2):
            due = self._whole_poses(body, pose, limits, stamp_ns, dense=dense)
        if single:
            whole = due.whole or busy
            limbs = [] if whole else self._one_limb(body.limbs, lost, areas_m2, stamp_ns)
            return replace(due, limbs=limbs)
        if dense and since_ns < VERY_DENSE_NS and not badly:
            limbs = [*lost] or self._suspects(stamp_ns, areas_m2)[:1]
            put_off = due.whole or busy or bool(limbs)
            in_turn = self._round_robin.take(body.limbs, put_off=put_off, single=True)
            return replace(due, limbs=limbs, begun=[n for n in in_turn if n not in limbs])
        limbs = [*dict.fromkeys((*lost, *self._suspects(stamp_ns, areas_m2)))]
        put_off = dense and (due.whole or bool(limbs))
        in_turn = self._round_robin.take(body.limbs, put_off=put_off, single=late)
        others = body.limbs if badly and not late else in_turn
        limbs += [name for name in others if name not in limbs]
        return replace(due, limbs=limbs)

    def found(self, name: str) -> None:
        """Note that a limb was found elsewhere."""
        self._waits.pop(name, None)

    def failed(self, name: str, stamp_ns: int, area_m2: float) -> None:
        """Note that a search of a limb had no gain, with that unexplained silhouette near it."""
        failures = 1
        before = self._waits.get(name)
        if before is not None and area_m2 <= _GROWN * before.area_m2:
            failures = min(before.failures + 1, 1 + _DOUBLINGS)
        self._waits[name] = _Wait(failures, stamp_ns, area_m2)

    def _whole_poses(
        self, body: BodyModel, pose: FloatArray, limits: FloatArray, stamp_ns: int, *, dense: bool
    ) -> Due:
        """The comparisons of whole poses that are due; where frames are dense, one at most."""
        pair = self.exchange.take_due(body, pose, limits, stamp_ns)
        if dense and pair:
            return Due(pair)
        facing = self.facing.take_due(stamp_ns)
        if dense and facing:
            return Due(pair, facing)
        return Due(pair, facing, self.walking.take_due(body, pose, limits, stamp_ns))

    def _one_limb(
        self,
        limbs: Sequence[str],
        lost: Sequence[str],
        areas_m2: Mapping[str, float],
        stamp_ns: int,
    ) -> list[str]:
        """The limb to search where there is time for one, if any is due.

        Limbs in doubt are searched in rotation, and in between those that nothing suggests.
        """
        doubted = [*dict.fromkeys((*lost, *self._rested(areas_m2, areas_m2, stamp_ns)))]
        self._rounds += 1
        if self._rounds % (len(doubted) + 1) == 0 and (
            in_turn := self._round_robin.take(limbs, single=True)
        ):
            return in_turn
        # The one whose last search lies farthest back.
        names = sorted(doubted, key=lambda name: self._round_of.get(name, 0))[:1]
        self._round_of.update(dict.fromkeys(names, self._rounds))
        return names

    def _suspects(self, stamp_ns: int, areas_m2: Mapping[str, float]) -> list[str]:
        """The limb likeliest to lie in unexplained silhouette, and one of the others in rotation,
        if they are `_rested`.
        """
        if not areas_m2:
            self._unexplained = 0
            return []
        self._unexplained += 1
        first, *others = areas_m2
        names = [first, *others[(self._unexplained - 1) % len(others) :][:1]] if others else [first]
        return self._rested(names, areas_m2, stamp_ns)

    def _rested(
        self, names: Iterable[str], areas_m2: Mapping[str, float], stamp_ns: int
    ) -> list[str]:
        """The limbs whose last search has not failed a short time ago."""
        waits = self._waits
        return [n for n in names if n not in waits or waits[n].over(stamp_ns, areas_m2[n])]
