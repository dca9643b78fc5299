"""Search of the stature and the girth of an unknown person, and their costs."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import MEAN_STATURE_M
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.population import FramePopulation, Population, scaled_to
from markerless_tracker.tracking.evidence.hull import Hull
from markerless_tracker.tracking.search import Searcher, SearcherFor

STATURES = (0.84, 0.88, 0.92, 0.96, 1.0, 1.04)
"""Statures that are tried for an unknown person, as fractions of the hull's height; raised arms
make the hull higher than the person."""
COMMON_STATURES_M = (1.56, 1.63, 1.70, 1.77, 1.84)
"""Statures that are tried besides: a bent, squatting or sitting person is taller than the hull."""
STANDING_M = (1.45, 1.92)
"""A person with a lower hull does not stand upright; one with a higher hull has raised arms."""
RAISED_ARMS_M = 1.80
"""A hull of this height or more may be that of a person with raised arms."""
RAISED_ARMS_RATIO = 1.24
"""Height of a person with raised arms, in statures."""
GIRTHS = (0.92, 1.08, 1.16, 1.24)
"""Factors of all radii that are tried besides 1: after stature, people differ most in girth, and
clothes add to it. If the body is too thin, its arms are fitted inside the trunk's outline."""
FINER = (0.94, 0.97, 1.03)
"""Factors of the stature that are tried once the girth is known."""
_FINER_GIRTHS = (0.95, 1.05)
"""The same for the girth."""
_ITERATIONS, _TRUNCATION_M = 4, (0.12, 0.05)
"""Refinement of the pose with each size."""
_APART_M = 0.025
"""Least difference of two statures that are tried."""
_STATURE_RANGE_M = (1.2, 2.1)
_STATURE_SD_M = 0.10
_WEIGHT = 0.002
"""Cost, in units of f_s, of a stature or girth one standard deviation from the mean."""
_GIRTH_SD = 0.15


def first_statures_m(hull: Hull) -> tuple[float, ...]:
    """Statures to begin a search with, m, from the hull's height."""
    height_m = hull.height_m
    upright = STANDING_M[0] <= height_m <= STANDING_M[1]
    statures = [height_m if upright else MEAN_STATURE_M]
    if height_m >= RAISED_ARMS_M:
        statures.append(float(np.clip(height_m / RAISED_ARMS_RATIO, 1.5, 1.9)))
    return tuple(statures)


def statures_m(hull: Hull) -> Iterator[float]:
    """Statures to try with a pose that was found, m, ascending."""
    height_m = float(np.clip(hull.height_m, *_STATURE_RANGE_M))
    if height_m < STANDING_M[0]:
        height_m = MEAN_STATURE_M
    tried = {ratio * height_m for ratio in STATURES} | set(COMMON_STATURES_M)
    last = -np.inf
    for stature in sorted({float(np.clip(s, *_STATURE_RANGE_M)) for s in tried}):
        # Statures nearer to each other are tried later, by `FINER`.
        if stature - last >= _APART_M:
            last = stature
            yield stature


def stature_cost(stature_m: float) -> float:
    """Cost of a stature by its distance from the mean, in units of f_s."""
    return _WEIGHT * ((stature_m - MEAN_STATURE_M) / _STATURE_SD_M) ** 2


def girth_cost(girth: float) -> float:
    """Cost of a factor of all radii, in units of f_s."""
    return _WEIGHT * ((girth - 1.0) / _GIRTH_SD) ** 2


def with_girth(body: BodyModel, girth: float) -> BodyModel:
    """The body with all radii multiplied by a factor."""
    shape = body.cone_shape.copy()
    shape[:, :, :2] *= girth
    return replace(body, cone_shape=shape)


@dataclass(frozen=True, eq=False)
class Sized:
    """A population in a body of some size.

    Attributes:
        frame: the frame's evidence, prepared for that body.
        population: its poses.
        searcher: searches with the body.
    """

    frame: FramePopulation
    population: Population
    searcher: Searcher


class SizeSearch:
    """Finds the stature and the girth with which a population's best pose explains a frame best.

    Args:
        searcher_for: makes a searcher of a body.
        body: the body, used if the stature is known.
        sized: makes the body of a stature; None if the stature is known.
        girths: whether to try girths.
    """

    def __init__(
        self,
        searcher_for: SearcherFor,
        body: BodyModel,
        sized: Callable[[float], BodyModel] | None,
        girths: bool,
    ) -> None:
        self._searcher_for = searcher_for
        self._body = body
        self._sized = sized
        self._girths = girths
        self._stature_m: float | None = None
        self._girth = 1.0

    def coarse(
        self, found: Sized, hull: Hull, observations: Mapping[str, Observation], stamp_ns: int
    ) -> Sized:
        """Try statures near the hull's height; then girths, and statures near the best, if set.

        Args:
            found: the population.
            hull: of the person.
            observations: the frame's evidence.
            stamp_ns: its time.
        """
        if self._sized is not None:
            sizes = [(s, 1.0) for s in statures_m(hull)]
            self._stature_m = sizes[0][0]
            found = self._best(found, sizes, observations, stamp_ns, changes=True)
        if self._girths:
            girths = [(self._stature_m, girth) for girth in GIRTHS]
            found = self._best(found, girths, observations, stamp_ns)
            found = self._best(found, self._near(FINER), observations, stamp_ns)
        return found

    def finer(self, found: Sized, observations: Mapping[str, Observation], stamp_ns: int) -> Sized:
        """Try sizes near the one that was found; arguments as of `coarse`."""
        sizes = self._near(FINER)
        if self._girths:
            sizes += [(self._stature_m, factor * self._girth) for factor in _FINER_GIRTHS]
        return self._best(found, sizes, observations, stamp_ns)

    def _near(self, factors: tuple[float, ...]) -> list[tuple[float | None, float]]:
        if self._stature_m is None:
            return []
        return [(factor * self._stature_m, self._girth) for factor in factors]

    def _best(
        self,
        found: Sized,
        sizes: "list[tuple[float, float]] | list[tuple[float | None, float]]",
        observations: Mapping[str, Observation],
        stamp_ns: int,
        *,
        changes: bool = False,
    ) -> Sized:
        """The population in the body of the best size.

        Args:
            found: the population so far.
            sizes: pairs of stature (None: known) and girth.
            observations: the frame's evidence.
            stamp_ns: its time.
            changes: whether the size so far is no candidate.
        """
        known, poses = found.searcher.body, found.population.poses
        kept, least = found, np.inf
        if not changes:
            least = float(found.population.costs[0]) + self._cost(self._stature_m, self._girth)
        for stature_m, girth in sizes:
            searcher = self._searcher_for(self._made(stature_m, girth))
            moved = scaled_to(known, searcher.body, poses)
            contours = found.frame.contours.with_body(searcher.body)
            frame = FramePopulation(
                searcher, observations, stamp_ns, moved[0],
                contours=contours, charges_postures=found.frame.charges_postures,
            )  # fmt: skip
            refined = frame.refined(moved[:1], _ITERATIONS, _TRUNCATION_M)
            cost = float(frame.total_costs(refined)[0]) + self._cost(stature_m, girth)
            if cost < least:
                scaled = Population(moved, found.population.costs, found.population.headings)
                kept, least = Sized(frame, scaled, searcher), cost
                self._stature_m, self._girth = stature_m, girth
        if kept is found:
            return found
        return replace(kept, population=kept.frame.propagated(kept.population))

    def _made(self, stature_m: float | None, girth: float) -> BodyModel:
        body = self._body
        if self._sized is not None and stature_m is not None:
            body = self._sized(float(np.clip(stature_m, *_STATURE_RANGE_M)))
        return body if girth == 1.0 else with_girth(body, girth)

    @staticmethod
    def _cost(stature_m: float | None, girth: float) -> float:
        return girth_cost(girth) + (0.0 if stature_m is None else stature_cost(stature_m))
