"""Detects lost limbs, and schedules the searches for limbs and headings.

A limb outside the silhouettes is detected. A wrong limb inside the silhouettes goes undetected, so
all limbs are searched elsewhere in turn, and exchanges of both legs or both arms are tried.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import LimbState, Observation, TrackState
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.aimed import most_aimed
from markerless_tracker.tracking.limbs.exchange import CLOSE, PairExchange
from markerless_tracker.tracking.limbs.facing import FacingWatch
from markerless_tracker.tracking.limbs.inside import inside_fractions
from markerless_tracker.tracking.limbs.rivals import Rival
from markerless_tracker.tracking.limbs.search import LimbSearch, distance_m
from markerless_tracker.tracking.limbs.turns import LimbTurns
from markerless_tracker.tracking.limbs.unexplained import find_unexplained
from markerless_tracker.tracking.limbs.walking import CLOSE as WALKING_CLOSE
from markerless_tracker.tracking.limbs.walking import LEAST_GAIN as WALKING_GAIN
from markerless_tracker.tracking.limbs.walking import WalkingWatch
from markerless_tracker.tracking.loss import LimbTrack
from markerless_tracker.tracking.search import Searcher

DENSE_NS = 40_000_000
"""If frames follow each other faster than this, searches that can wait are put off to other frames,
since sets that come too late are lost."""
FIRST_WAIT_NS = 32_000_000
"""Time before a limb near unexplained silhouette is searched again, after one search without gain.
It doubles with each further search without gain, at most `_DOUBLINGS` times."""
SUSPECTED = 2
"""Number of limbs whose error may be as large as the unexplained silhouette."""
RECOVERED_M = 0.10
"""A limb that is found farther than this from its last place was wrong there."""
_DOUBLINGS = 4
_GROWN = 2.0
"""Earlier searches do not count once the unexplained area has grown by this factor."""


@dataclass(frozen=True, eq=False)
class Recovered:
    """Result of the searches of a frame.

    Attributes:
        pose: (p,) the estimate.
        names: of the limbs that were found elsewhere; `legs` or `arms` for an exchanged pair.
        rotated: whether another heading was found; no parameter continues its last value then.
        moved_m: largest distance by which the searches moved a marker; 0 if `rotated`.
    """

    pose: FloatArray
    names: tuple[str, ...] = ()
    rotated: bool = False
    moved_m: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages for the user, one line each."""
        if self.rotated:
            return ("the person faces another way: turned round",)
        return tuple(f"{name}: found elsewhere" for name in self.names)

    def jumped(self, body: BodyModel) -> IntArray:
        """Indices of the parameters that do not continue those of the last frame."""
        if self.rotated:
            return np.arange(body.size)
        return np.array([i for name in self.names for i in body.subspaces[name]], dtype=np.int64)

    def placed(self, body: BodyModel, limits: FloatArray, corrected: FloatArray) -> FloatArray:
        """The pose (p,), within limits except for limbs that were wrong.

        Args:
            body: the body.
            limits: (2, p) of the parameters that continue those of the last frame.
            corrected: (2, p) of limbs that were found elsewhere, but nearer than `RECOVERED_M`.
        """
        pose, jumped = np.clip(self.pose, *limits), self.jumped(body)
        pose[jumped] = self.pose[jumped]
        if not self.rotated and self.moved_m <= RECOVERED_M:
            pose[jumped] = np.clip(pose, *corrected)[jumped]
        return np.asarray(pose)


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


class LimbWatch:
    """Detects lost limbs and searches for them; other limbs are searched in turn.

    It also schedules the exchanges of legs or arms and the comparisons of headings.

    Args:
        rig: the cameras; an attribute, which may be replaced between frames.
    """

    def __init__(self, rig: CameraRig) -> None:
        self.rig = rig
        self.reset()

    def reset(self) -> None:
        """Forget the limbs so far."""
        self._tracks: dict[str, LimbTrack] = {}
        self._turns = LimbTurns()
        self._calls = 0
        self._rounds = 0
        self._round_of: dict[str, int] = {}
        self._unexplained = 0
        self._areas_m2: dict[str, float] = {}
        self._rivals: dict[str, Rival] = {}
        self._last_ns: int | None = None
        self._waits: dict[str, _Wait] = {}
        self._exchange = PairExchange()
        self._facing = FacingWatch()
        self._walking = WalkingWatch()

    @property
    def lost(self) -> tuple[str, ...]:
        """Limbs that were lost when last assessed."""
        return tuple(n for n, track in self._tracks.items() if track.state is TrackState.LOST)

    @property
    def suspected_m(self) -> dict[str, float]:
        """Size of the unexplained silhouette that a limb may belong to, of the likeliest limbs.

        It is the root of the area that was found when limbs were searched last.
        """
        likeliest = tuple(self._areas_m2.items())[:SUSPECTED]
        return {name: float(np.sqrt(area_m2)) for name, area_m2 in likeliest}

    @property
    def rivals(self) -> dict[str, Rival]:
        """Other places of limbs, each as of the limb's last search."""
        return dict(self._rivals)

    def assess(
        self,
        body: BodyModel,
        pose: FloatArray,
        observations: Mapping[str, Observation],
        particle_sd_ratio: FloatArray,
    ) -> dict[str, LimbState]:
        """The state of each limb at a pose (p,), by name.

        Args:
            body: the body.
            pose: the estimate.
            observations: the silhouettes.
            particle_sd_ratio: (p,) as in `FrameSearch`.
        """
        fractions = inside_fractions(body, pose, observations, self.rig)
        states = {}
        for name in body.limbs:
            inside_fraction = fractions.get(name, float("nan"))
            wide = float(np.sqrt(np.mean(particle_sd_ratio[body.subspaces[name]] ** 2)))
            track = self._tracks.setdefault(name, LimbTrack())
            state = track.note(inside_fraction, wide) if name in fractions else track.state
            states[name] = LimbState(state, inside_fraction, wide)
        return states

    def recover(
        self,
        searcher: Searcher,
        contours: ContourFrame,
        seen: Seen,
        pose: FloatArray,
        *,
        badly: bool = False,
        late: bool = False,
        single: bool = False,
    ) -> Recovered:
        """Run the searches that are due: other headings, exchanges of legs or arms, and limbs.

        Limbs that are due are the lost ones, those near unexplained silhouette, and some in turn. A
        result is taken by the rules of `LimbSearch`; headings and exchanges have least gains of
        their own (`facing`, `walking`, `exchange`).

        Args:
            searcher: of the frame.
            contours: the frame's contours.
            seen: the frame's evidence.
            pose: (p,) the estimate.
            badly: whether the frame is explained worse than usual; if not `late`, all limbs are
                due.
            late: whether sets come faster than they are tracked; one limb in turn is due.
            single: whether there is time for a single search: a comparison of whole poses and a
                search of one limb alternate then.
        """
        body, stamp_ns, observations = searcher.body, seen.stamp_ns, seen.used
        if not body.limbs:
            return Recovered(pose)
        unexplained = find_unexplained(body, pose, observations, self.rig)
        self._areas_m2 = dict(unexplained.areas_m2)
        if not unexplained.limbs:
            self._waits.clear()
        pair, facing, walking = None, False, []
        self._calls += 1
        self._walking.note(body, pose, stamp_ns)
        since_ns = 0 if self._last_ns is None else max(0, stamp_ns - self._last_ns)
        dense = self._last_ns is not None and since_ns < DENSE_NS
        self._last_ns = stamp_ns
        self._turns.advance(since_ns)
        if not single or self._calls % 2:
            pair = self._exchange.due(body, pose, searcher.limits, stamp_ns)
            if not (dense and pair):
                facing = self._facing.due(stamp_ns)
            if not (dense and (pair or facing)):
                walking = self._walking.due(body, pose, searcher.limits, stamp_ns)
        whole = facing or pair is not None or bool(walking)
        if single:
            due = [] if whole else self._one_limb(body.limbs, unexplained.areas_m2, stamp_ns)
        else:
            due = [*dict.fromkeys((*self.lost, *self._suspects(stamp_ns, unexplained.areas_m2)))]
            put_off = dense and (whole or bool(due))
            in_turn = self._turns.take(body.limbs, put_off=put_off, single=late)
            others = body.limbs if badly and not late else in_turn
            due += [name for name in others if name not in due]
        if not due and not whole:
            return Recovered(pose)
        frame = FramePopulation(searcher, observations, stamp_ns, pose, contours=contours)
        radius_m = searcher.tracked_radius_m
        own = OwnEvidence(searcher, seen.imaged, stamp_ns, frame, radius_m=radius_m)
        recombiner = Recombiner(body, searcher.limits)
        search = LimbSearch(
            recombiner, frame, own, pose, searcher.config.min_improvement, thorough=not late
        )
        if facing:
            rotated = self._facing.compare(search, body, searcher.limits)
            if rotated is not None:
                self._rivals = {}
                self._exchange.forget_gains()
                return Recovered(rotated, rotated=True)
        for other in walking:
            if search.takes(other, WALKING_GAIN, WALKING_CLOSE):
                # The sums were of comparisons with the former heading.
                self._rivals = {}
                self._facing.reset()
                self._exchange.forget_gains()
                return Recovered(search.pose, rotated=True)
        found = []
        if pair:
            best = search.cheapest(pair.poses)
            other, gain = search.compared(pair.poses[best], CLOSE)
            other_m = distance_m(body, other, pose)
            if self._exchange.takes(pair.name, gain, pair.least_gains[best], other_m):
                search.take(other)
                self._rivals = {}
                found.append(pair.name)
        for name in due:
            rng = keyed_generator(searcher.config.seed, stamp_ns, f"{name} elsewhere")
            limb = body.subspaces[name]
            aim = None
            if unexplained.regions:
                aim = partial(
                    most_aimed, body, limb=limb, regions=unexplained.regions, rig=self.rig
                )
            taken = search.elsewhere(limb, rng, aim)
            self._rivals.pop(name, None)
            if search.rival is not None:
                self._rivals[name] = search.rival
            if taken:
                found.append(name)
                self._waits.pop(name, None)
            else:
                self._search_failed(name, stamp_ns, unexplained.areas_m2.get(name, 0.0))
        if found:
            # They explain at least a part of the silhouette; the next search finds the rest.
            self._areas_m2 = {}
        moved_m = distance_m(body, search.pose, pose)
        return Recovered(search.pose, tuple(found), moved_m=moved_m)

    def _one_limb(
        self, limbs: Sequence[str], areas_m2: Mapping[str, float], stamp_ns: int
    ) -> list[str]:
        """The limb to search where there is time for one, if any is due.

        Limbs in doubt are searched in rotation, and in between those that nothing suggests.
        """
        doubted = [*dict.fromkeys((*self.lost, *self._rested(areas_m2, areas_m2, stamp_ns)))]
        self._rounds += 1
        if self._rounds % (len(doubted) + 1) == 0 and (
            in_turn := self._turns.take(limbs, single=True)
        ):
            return in_turn
        # The one whose last search lies farthest back.
        names = sorted(doubted, key=lambda name: self._round_of.get(name, 0))[:1]
        self._round_of.update(dict.fromkeys(names, self._rounds))
        return names

    def _search_failed(self, name: str, stamp_ns: int, area_m2: float) -> None:
        failures = 1
        before = self._waits.get(name)
        if before is not None and area_m2 <= _GROWN * before.area_m2:
            failures = min(before.failures + 1, 1 + _DOUBLINGS)
        self._waits[name] = _Wait(failures, stamp_ns, area_m2)

    def _suspects(self, stamp_ns: int, areas_m2: Mapping[str, float]) -> list[str]:
        """The limb likeliest to lie in unexplained silhouette, and one of the others in turn, if
        they are `_rested`.
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
