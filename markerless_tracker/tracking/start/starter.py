"""The automatic start: finds a person in one frame and confirms the heading over some more."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraRig
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.mirror import TRUNK
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation, Population
from markerless_tracker.tracking.candidates.postures import put_at
from markerless_tracker.tracking.evidence.hull import Hull, find_hulls
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.loss import LEAST_FIT
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.search import Searcher, SearcherFor
from markerless_tracker.tracking.start.estimate import StartEstimate
from markerless_tracker.tracking.start.final_search import TURNED, searched_again
from markerless_tracker.tracking.start.generations import improved
from markerless_tracker.tracking.start.in_view import InViewGate
from markerless_tracker.tracking.start.rejections import Rejections
from markerless_tracker.tracking.start.settling import with_fitted_body
from markerless_tracker.tracking.start.silhouettes import silhouettes_in_hull
from markerless_tracker.tracking.start.sizing import (
    Sized,
    SizeSearch,
    first_statures_m,
    stature_cost,
)
from markerless_tracker.tracking.start.two_headings import HeadingFit, TwoHeadings
from markerless_tracker.tracking.start.uncrossed import uncrossed

GENERATIONS = 7
"""Generations of the search of the first frame."""
SECOND_GENERATIONS = 5
"""Generations of the search of the second frame."""
_GENERATION_FRACTION = 0.5
"""Size of the one generation in each later frame, as a fraction of the full size."""
_RESIZED_AFTER = 3
"""Generation after which the sizes are tried in the first frame."""
_FINER_AFTER = 1
"""Frames between the second search and the finer sizes, so that no frame has to do both."""
GAP_NS = 150_000_000
"""After a longer gap, such as a live first search, a refinement may not reach the person."""
_GAP_GENERATIONS = 2
"""Generations after such a gap."""
_DOUBTFUL = 0.12
"""If the first search's best pose costs more, later ones add a cost of unusual postures. The next
one is that of the second frame, so that the first pose is not delayed."""
_SURE_FIT, _SURE_GAP = 0.91, 0.025
"""The second frame is not searched independently if 1 - cost of the best pose is at least
`_SURE_FIT`, and lower by at least `_SURE_GAP` for the opposite heading."""

Select = Callable[
    [Mapping[str, Observation], BodyModel, FloatArray],
    tuple[dict[str, Observation], tuple[str, ...]],
]


class Starter:
    """Finds a person in the views, without a start pose.

    First guesses are many postures and headings of a body of the person's stature (several are
    tried if it is unknown). The best ones are refined, recombined and refined again. Unless they
    fit well, the second frame is searched independently, too. If they fit poorly, that search has a
    cost of unusual postures, by which the poses of both are compared; if they fit no person, it is
    made in the first frame. Legs and arms are tried in each other's place, and in every frame
    crossed ones are compared with uncrossed ones (`uncrossed`). The opposite heading is propagated,
    too, until one is kept (`two_headings`). Then the body is fitted (`with_fitted_body`), and the
    last frame is searched independently with it (`searched_again`).

    Args:
        rig: the cameras.
        body: the body; its lengths are the person's if `sized` is None.
        searcher_for: makes a searcher of a body.
        select: keeps the parts of silhouettes that a pose explains.
        sized: makes the body of a stature; None if the stature is known.
        fit_shape: whether to fit the body in the end.
        person: as in `fitted_to_start`.
        last_pose: (p,) pose at which the person was lost; None if there was none.
    """

    def __init__(
        self,
        rig: CameraRig,
        body: BodyModel,
        searcher_for: SearcherFor,
        select: Select,
        *,
        sized: Callable[[float], BodyModel] | None = None,
        fit_shape: bool = True,
        person: Unmeasured | None = None,
        last_pose: FloatArray | None = None,
    ) -> None:
        self._cameras = {camera.name: camera for camera in rig}
        self._body = body
        self._searcher_for = searcher_for
        self._select = select
        self._sized = sized
        self._fit_shape = fit_shape
        self._person = person
        self._last_pose = last_pose
        self._in_view = InViewGate()
        self._rejections = Rejections()
        self.reset()

    def reset(self) -> None:
        """Forget the person so far; rejected hulls are remembered."""
        self._in_view.reset()
        self._population: Population | None = None
        self._stamp_ns = 0
        self._searcher: Searcher | None = None
        self._headings = TwoHeadings(0.0)
        self._sure = self._charges_postures = False
        self._sizes = SizeSearch(self._searcher_for, self._body, self._sized, self._fit_shape)

    def step(
        self, observed: Mapping[str, Observation], stamp_ns: int, *, late: bool = False
    ) -> StartEstimate | None:
        """Search one frame; None without a person.

        Args:
            observed: the observations of the usable cameras.
            stamp_ns: their time.
            late: whether sets come faster than they are searched. Then the second frame is not
                searched independently, and the last one only if the first search left doubt.
        """
        if self._population is None or self._searcher is None:
            return self._begin(observed, stamp_ns)
        population = self._population
        far = not 0 <= stamp_ns - self._stamp_ns <= GAP_NS
        if far:
            population = self._moved(population, observed)
        best = self._best(population).poses[0]
        imaged, notes = self._select(observed, self._searcher.body, best)
        observations = imaged
        again = len(self._headings) == 1 and not self._sure and not late
        if any(seen.undecided_words is not None for seen in imaged.values()):
            observations = self._decide(imaged, best, by_hull=again)
        near = population.poses[0]
        frame = FramePopulation(
            self._searcher, observations, stamp_ns, near, charges_postures=self._charges_postures
        )
        population = frame.propagated(population, far=far)
        if far:
            self._headings.restart()
            population = improved(frame, population, range(1, 1 + _GAP_GENERATIONS))
        if again:
            population = self._second_search(frame, population, observations)
        elif len(self._headings) == 1 + _FINER_AFTER:
            frame, population = self._resized((frame, population), observations, stamp_ns)
        population = frame.recombined(population, 0, fraction=_GENERATION_FRACTION)
        own = OwnEvidence(self._searcher, imaged, stamp_ns, frame)
        population = uncrossed(own, frame, population, self._best)
        if 1.0 - frame.best_cost(population) < LEAST_FIT:
            self.reset()
            return None
        self._population, self._stamp_ns = population, stamp_ns
        self._note(own, frame, population, stamp_ns)
        if self._headings.change():
            notes += (TURNED,)
        searcher, settled = self._searcher, self._headings.over
        leading = self._best(population)
        self._headings.follow(float(leading.headings[0]))
        pose = leading.poses[0]
        if settled and self._fit_shape:
            searcher, pose = with_fitted_body(
                searcher, self._searcher_for, self._person, fits=self._headings.leading_fits,
                contours=frame.contours, pose=pose,
            )  # fmt: skip
            if not (late and self._sure):
                charges = self._charges_postures
                pose, turned = searched_again(searcher, pose, imaged, stamp_ns, charges)
                notes += turned
        return StartEstimate(searcher, pose, observations, settled, notes)

    def _begin(self, observed: Mapping[str, Observation], stamp_ns: int) -> StartEstimate | None:
        cameras = [self._cameras[name] for name in observed]
        self._rejections.begin_frame(stamp_ns)
        for hull in find_hulls(self._cameras, observed):
            # A search takes long, so a person hardly in view is not searched. How long one is in
            # view counts while the hull waits, too.
            standing = put_at(self._body, hull, self._body.neutral)
            enough = self._in_view.enough(self._body, standing, cameras, stamp_ns)
            if self._rejections.waits(hull) or not enough:
                continue
            observations = silhouettes_in_hull(observed, self._cameras, hull)
            found = self._search(hull, observations, stamp_ns)
            if found is None:
                self._rejections.note(hull)
                continue
            frame, population = found
            assert self._searcher is not None
            best = population.poses[0]
            if not self._in_view.enough(self._searcher.body, best, cameras, stamp_ns):
                continue
            self._headings = TwoHeadings(float(population.headings[0]))
            self._sure = _is_sure(population)
            own = OwnEvidence(self._searcher, observations, stamp_ns, frame)
            population = uncrossed(own, frame, population, self._best)
            self._population, self._stamp_ns = population, stamp_ns
            self._note(own, frame, population, stamp_ns)
            leading = self._best(population).poses[0]
            return StartEstimate(self._searcher, leading, observations, False)
        return None

    def _moved(self, population: Population, observed: Mapping[str, Observation]) -> Population:
        """A population moved to where the person is now."""
        assert self._searcher is not None
        body, was_m = self._searcher.body, self._trunk(population.poses[0])
        if not (found := list(find_hulls(self._cameras, observed))):
            return population
        # Not an object that was searched before, nor one farther off than the person.
        hulls = [h for h in found if not self._rejections.rejected(h)] or found
        hull = min(hulls, key=lambda h: float(np.linalg.norm(h.trunk_m.mean(axis=0) - was_m)))
        poses = [put_at(body, hull, pose) for pose in population.poses]
        return replace(population, poses=np.array(poses))

    def _decide(
        self, observations: Mapping[str, Observation], pose: FloatArray, *, by_hull: bool
    ) -> dict[str, Observation]:
        """Observations whose undecided pixels the body at a pose (p,) decides.

        In a second frame that is searched independently, the hull decides before the body.
        """
        assert self._searcher is not None
        if by_hull:
            hull = next(find_hulls(self._cameras, observations), None)
            if hull is not None:
                observations = silhouettes_in_hull(observations, self._cameras, hull)
        return decide(observations, self._cameras, self._searcher.body, pose)

    def _second_search(
        self,
        frame: FramePopulation,
        population: Population,
        observations: Mapping[str, Observation],
    ) -> Population:
        """Search the second frame independently, too: it may find what the first search missed."""
        hull = next(find_hulls(self._cameras, observations), None)
        if hull is None:
            return population
        fresh = frame.initialised(frame.guesses(hull))
        fresh = improved(frame, fresh, range(1, 1 + SECOND_GENERATIONS))
        return frame.selected(np.concatenate([population.poses, fresh.poses]))

    def _search(
        self, hull: Hull, observations: Mapping[str, Observation], stamp_ns: int
    ) -> tuple[FramePopulation, Population] | None:
        """The population found in a hull; None if it is no person."""
        self._charges_postures = False
        frame, population = first = self._search_once(hull, observations, stamp_ns)
        cost = frame.best_cost(population)
        self._charges_postures = cost > _DOUBTFUL
        if 1.0 - cost < LEAST_FIT:
            frame, population = self._search_once(hull, observations, stamp_ns)
            population = frame.with_found(population, *first)
        return (frame, population) if 1.0 - frame.best_cost(population) >= LEAST_FIT else None

    def _search_once(
        self, hull: Hull, observations: Mapping[str, Observation], stamp_ns: int
    ) -> tuple[FramePopulation, Population]:
        self._sizes = SizeSearch(self._searcher_for, self._body, self._sized, self._fit_shape)
        frame, population = self._initialised(hull, observations, stamp_ns)
        population = improved(frame, population, range(1 + _RESIZED_AFTER))
        found = self._resized((frame, population), observations, stamp_ns, hull)
        population = improved(*found, range(1 + _RESIZED_AFTER, GENERATIONS))
        return found[0], found[0].with_exchanged_pairs(population, GENERATIONS)

    def _resized(
        self,
        found: tuple[FramePopulation, Population],
        observations: Mapping[str, Observation],
        stamp_ns: int,
        hull: Hull | None = None,
    ) -> tuple[FramePopulation, Population]:
        """A population in the body of the best size; all sizes with a hull, else only near ones."""
        assert self._searcher is not None
        sized = Sized(*found, self._searcher)
        if hull is None:
            sized = self._sizes.finer(sized, observations, stamp_ns)
        else:
            sized = self._sizes.coarse(sized, hull, observations, stamp_ns)
        self._searcher = sized.searcher
        return sized.frame, sized.population

    def _initialised(
        self, hull: Hull, observations: Mapping[str, Observation], stamp_ns: int
    ) -> tuple[FramePopulation, Population]:
        """The first population: of the stature whose best guess costs least."""
        bodies = [(self._body, 0.0)]
        if self._sized is not None:
            statures = first_statures_m(hull)
            bodies = [(self._sized(s), stature_cost(s)) for s in statures]
        tried = []
        for body, cost in bodies:
            searcher = self._searcher_for(body)
            near = body.neutral.copy()
            near[body.root_position] = hull.trunk_m.mean(axis=0)
            frame = FramePopulation(
                searcher, observations, stamp_ns, near, charges_postures=self._charges_postures
            )
            last = self._last_pose
            hints = None if last is None else np.array([last, put_at(body, hull, last)])
            guesses = frame.guesses(hull, hints)
            tried.append((float(frame.total_costs(guesses).min()) + cost, searcher, frame, guesses))
        _, self._searcher, frame, guesses = min(tried, key=lambda candidate: candidate[0])
        return frame, frame.initialised(guesses)

    def _note(
        self, own: OwnEvidence, frame: FramePopulation, population: Population, stamp_ns: int
    ) -> None:
        def fit(heading_rad: float) -> HeadingFit | None:
            facing = population.facing(heading_rad)
            if not len(facing):
                return None
            best = facing.poses[0]
            return HeadingFit(frame.contours, best, own.cost_with_prior(best), self._trunk(best))

        first, opposite = (fit(heading_rad) for heading_rad in self._headings.both_rad)
        self._headings.note(stamp_ns, (first, opposite))

    def _best(self, population: Population) -> Population:
        """The poses of a population with the leading heading; all poses if none has it."""
        facing = population.facing(self._headings.leading_rad)
        return facing if len(facing) else population

    def _trunk(self, pose: FloatArray) -> FloatArray:
        assert self._searcher is not None
        return np.asarray(markers(self._searcher.body, pose)[TRUNK].mean(axis=0))


def _is_sure(population: Population) -> bool:
    """Whether the first frame's population leaves no doubt about posture and heading."""
    opposite = population.facing(float(population.headings[0]) + np.pi).costs[:1]
    gap = float(opposite[0] - population.costs[0]) if opposite.size else np.inf
    return 1.0 - float(population.costs[0]) >= _SURE_FIT and gap >= _SURE_GAP
