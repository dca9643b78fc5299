"""Detects lost limbs, and runs the searches for limbs and headings.

A limb outside the silhouettes is detected. A wrong limb inside the silhouettes goes undetected, so
all limbs are searched elsewhere in rotation, and exchanges of both legs or both arms are tried.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np

from markerless_tracker.body import BodyModel
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
from markerless_tracker.tracking.limbs.exchange import CLOSE, Exchange
from markerless_tracker.tracking.limbs.inside import inside_fractions
from markerless_tracker.tracking.limbs.recovered import Recovered
from markerless_tracker.tracking.limbs.rivals import Rival
from markerless_tracker.tracking.limbs.schedule import Due, LimbSchedule
from markerless_tracker.tracking.limbs.search import LimbSearch, distance_m
from markerless_tracker.tracking.limbs.unexplained import Unexplained, find_unexplained
from markerless_tracker.tracking.limbs.walking import CLOSE as WALKING_CLOSE
from markerless_tracker.tracking.limbs.walking import LEAST_GAIN as WALKING_GAIN
from markerless_tracker.tracking.loss import LimbTrack
from markerless_tracker.tracking.search import Searcher

SUSPECTED = 2
"""Number of limbs whose error may be as large as the unexplained silhouette."""


class LimbWatch:
    """Detects lost limbs, and runs the searches for limbs and headings that are due.

    Args:
        rig: the cameras; an attribute, which may be replaced between frames.
    """

    def __init__(self, rig: CameraRig) -> None:
        self.rig = rig
        self.reset()

    def reset(self) -> None:
        """Forget the limbs so far."""
        self._tracks: dict[str, LimbTrack] = {}
        self._schedule = LimbSchedule()
        self._areas_m2: dict[str, float] = {}
        self._views = 1
        self._rivals: dict[str, Rival] = {}
        self._begun: dict[str, FloatArray] = {}

    @property
    def lost(self) -> tuple[str, ...]:
        """Limbs that were lost when last assessed."""
        return tuple(n for n, track in self._tracks.items() if track.state is TrackState.LOST)

    @property
    def suspected_m(self) -> dict[str, float]:
        """Size of the unexplained silhouette that a limb may belong to, of the likeliest limbs.

        It is the root of the mean area in a view that was found when limbs were searched last.
        """
        likeliest = tuple(self._areas_m2.items())[:SUSPECTED]
        return {name: float(np.sqrt(area_m2 / self._views)) for name, area_m2 in likeliest}

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

        A result is taken by the rules of `LimbSearch`; headings and exchanges have least gains of
        their own (`facing`, `walking`, `exchange`). Limbs that the frame before drew are compared.

        Args:
            searcher: of the frame.
            contours: the frame's contours.
            seen: the frame's evidence.
            pose: (p,) the estimate.
            badly: whether the frame is explained worse than usual; if not `late`, all limbs are
                due.
            late: whether sets come faster than they are tracked; one limb of the rotation is due.
            single: whether there is time for a single search: a comparison of whole poses and a
                search of one limb alternate then.
        """
        if not searcher.body.limbs:
            return Recovered(pose)
        unexplained = find_unexplained(searcher.body, pose, seen.used, self.rig)
        self._areas_m2, self._views = dict(unexplained.areas_m2), len(seen.used)
        begun, self._begun = self._begun, {}
        due = self._schedule.take(
            searcher.body, pose, searcher.limits, seen.stamp_ns, lost=self.lost,
            areas_m2=unexplained.areas_m2, badly=badly, late=late, single=single, busy=bool(begun),
        )  # fmt: skip
        if not (due or begun):
            return Recovered(pose)
        search = _search(searcher, contours, seen, pose, thorough=not late)
        if self._compare_headings(search, due, searcher):
            # Rivals, and sums of earlier comparisons, were those of the former heading.
            self._rivals, self._areas_m2 = {}, {}
            self._schedule.exchange.forget_gains()
            return Recovered(search.pose, rotated=True, searched=True)
        found = []
        if due.pair is not None and self._compare_exchange(search, due.pair, searcher.body):
            self._rivals = {}
            found.append(due.pair.name)
        for name, drawn in begun.items():
            if self._take_limb(search, name, drawn, searcher, unexplained, seen.stamp_ns):
                found.append(name)
        for name in (name for name in due.limbs if name not in begun):
            drawn = self._draw_limb(search, name, searcher, unexplained, seen.stamp_ns)
            if self._take_limb(search, name, drawn, searcher, unexplained, seen.stamp_ns):
                found.append(name)
        for name in due.begun:
            self._begun[name] = self._draw_limb(search, name, searcher, unexplained, seen.stamp_ns)
        if found:
            # They explain at least a part of the silhouette; the next search finds the rest.
            self._areas_m2 = {}
        moved_m = distance_m(searcher.body, search.pose, pose)
        compared = bool(begun or due.whole or due.limbs)
        return Recovered(search.pose, tuple(found), searched=compared, moved_m=moved_m)

    def _compare_headings(self, search: LimbSearch, due: Due, searcher: Searcher) -> bool:
        """Compare the other headings that are due; whether one was taken."""
        if due.facing:
            rotated = self._schedule.facing.compare(search, searcher.body, searcher.limits)
            if rotated is not None:
                search.pose = rotated
                return True
        for other in due.walking:
            if search.take_if_better(other, WALKING_GAIN, WALKING_CLOSE):
                self._schedule.facing.reset()
                return True
        return False

    def _compare_exchange(self, search: LimbSearch, pair: Exchange, body: BodyModel) -> bool:
        """Compare an exchange of both legs or both arms; whether it was taken."""
        best = search.cheapest(pair.poses)
        other, gain = search.compared(pair.poses[best], CLOSE)
        moved_m = distance_m(body, other, search.pose)
        schedule = self._schedule.exchange
        if not schedule.add_comparison(pair.name, gain, pair.least_gains[best], moved_m):
            return False
        search.pose = other
        return True

    def _draw_limb(
        self,
        search: LimbSearch,
        name: str,
        searcher: Searcher,
        unexplained: Unexplained,
        stamp_ns: int,
    ) -> FloatArray:
        """The best draws (n, d) of a limb in its whole range."""
        body = searcher.body
        limb, aim = body.subspaces[name], None
        if unexplained.regions:
            aim = partial(most_aimed, body, limb=limb, regions=unexplained.regions, rig=self.rig)
        rng = keyed_generator(searcher.config.seed, stamp_ns, f"{name} elsewhere")
        return search.drawn(limb, rng, aim)

    def _take_limb(
        self,
        search: LimbSearch,
        name: str,
        drawn: FloatArray,
        searcher: Searcher,
        unexplained: Unexplained,
        stamp_ns: int,
    ) -> bool:
        """Compare draws (n, d) of a limb with the estimate; whether it was found elsewhere."""
        found = search.take_drawn(searcher.body.subspaces[name], drawn)
        self._rivals.pop(name, None)
        if search.rival is not None:
            self._rivals[name] = search.rival
        if found:
            self._schedule.found(name)
        else:
            self._schedule.failed(name, stamp_ns, unexplained.areas_m2.get(name, 0.0))
        return found


def _search(
    searcher: Searcher, contours: ContourFrame, seen: Seen, pose: FloatArray, *, thorough: bool
) -> LimbSearch:
    """The searches of a frame, with its evidence; arguments as for `LimbWatch.recover`."""
    frame = FramePopulation(searcher, seen.used, seen.stamp_ns, pose, contours=contours)
    own = OwnEvidence(
        searcher, seen.imaged, seen.stamp_ns, frame, radius_m=searcher.tracked_radius_m
    )
    recombiner = Recombiner(searcher.body, searcher.limits)
    return LimbSearch(
        recombiner, frame, own, pose, searcher.config.min_improvement, thorough=thorough
    )
