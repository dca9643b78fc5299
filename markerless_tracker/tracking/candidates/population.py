"""A population of poses of one frame, improved by recombination, refinement and selection."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from markerless_tracker.body import BodyModel, markers_of_many
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.body.model import IntArray
from markerless_tracker.fitness import Evaluator
from markerless_tracker.fitness.contour import RADIUS_M, SPACING_M, ContourFrame
from markerless_tracker.fitness.threads import side_by_side, usable_threads
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import Comparison, Observation
from markerless_tracker.tracking.candidates.crossed import PAIRS, in_each_others_place
from markerless_tracker.tracking.candidates.posture_costs import unlike_postures
from markerless_tracker.tracking.candidates.postures import first_guesses
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.evidence.hull import Hull
from markerless_tracker.tracking.refinement import pose_prior, refined_on_contours
from markerless_tracker.tracking.search import FrameSearch, Searcher

PER_QUARTER = 4
"""Poses that are kept in each quarter of the headings, relative to the best pose's heading."""
_INITIALISED_COUNT = 24
"""First guesses that are refined."""
_PER_HEADING = 2
"""First guesses of each heading that are candidates for it."""
_CHILDREN = 480
"""Children of a generation."""
_REFINED = 10
"""Children of a generation that are refined."""
_NOVEL = 0.6
"""Fraction of the refined children that must differ from the parents and from each other. The
others are the best children, which are mostly parents with a small change."""
_NOVEL_M = 0.20
"""Poses differ if some marker lies farther apart than this."""
_ALIKE_M = 0.07
"""Poses are the same if their markers lie nearer to each other than this, on average."""
_PRIOR_WEIGHT = 4.0
"""Weight of the pose prior: a generic body's outline fits within some centimetres only."""
_INITIALISE = (6, (0.25, 0.08))
_RECOMBINE = (5, (0.15, 0.05))
_PROPAGATE = (3, (0.12, 0.05))
_EXCHANGE = (6, (0.25, 0.05))
"""Iterations of refinement, and first and last truncation in m: of an initialised population, of a
recombined one, of one propagated from the frame before, and of a pose with exchanged limbs."""
_SPARSE_M = 0.04
"""Distance of neighbouring outline points in the refinement of an initialised and of a recombined
population: twice the usual one, since many poses are refined, and the kept ones again."""
_EXCHANGED_SLACK = (0.012, 0.007)
"""A pose with exchanged limbs has a first and a second generation of children if its f_s is at most
this much less than that of the best pose."""


@dataclass(frozen=True, eq=False)
class Population:
    """Poses of one frame, the best first.

    Attributes:
        poses: (n, p).
        costs: (n,) of `FramePopulation.total_costs`, ascending.
        headings: (n,) rad.
    """

    poses: FloatArray
    costs: FloatArray
    headings: FloatArray

    def facing(self, heading_rad: float) -> "Population":
        """The poses within a right angle of a heading; may be empty."""
        near = np.array(
            [heading_difference(h, heading_rad) < 0.5 * np.pi for h in self.headings], bool
        )
        return Population(self.poses[near], self.costs[near], self.headings[near])

    def __len__(self) -> int:
        return len(self.poses)


class FramePopulation:
    """Makes populations of one frame.

    Args:
        searcher: the body, the cameras and the settings.
        observations: the evidence.
        stamp_ns: keys the draws, together with the seed.
        near: (p,) a pose whose root is near the person.
        contours: the frame's contour evidence, if it exists already.
        radius_m: as in `FrameSearch`, if it does not.
        charges_postures: whether unusual postures cost something.

    Attributes:
        near: as given.
        charges_postures: as given.
    """

    def __init__(
        self,
        searcher: Searcher,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        near: FloatArray,
        *,
        contours: ContourFrame | None = None,
        radius_m: float = RADIUS_M,
        charges_postures: bool = False,
    ) -> None:
        self.charges_postures = charges_postures
        self._searcher = searcher
        self._stamp_ns = stamp_ns
        self.near = near
        frame: FrameSearch | ContourFrame | None = contours
        if frame is None:
            frame = searcher.frame(observations, stamp_ns, near, radius_m=radius_m)
        self._frame = frame
        self._costs = searcher.overlap_fitness.prepare(
            frame.views, Comparison.whole(near, len(searcher.body.cone_names))
        )

    @property
    def contours(self) -> ContourFrame:
        """The frame's contour evidence, made on first use."""
        frame = self._frame
        return frame if isinstance(frame, ContourFrame) else frame.contours

    @cached_property
    def _per_thread(self) -> list[ContourFrame]:
        return [self.contours]

    @cached_property
    def _recombiner(self) -> Recombiner:
        return Recombiner(self._searcher.body, self._searcher.limits)

    def guesses(self, hull: Hull, hints: FloatArray | None = None) -> FloatArray:
        """Hints (n, p), and the best first guesses of a person in a hull, (m, p)."""
        rng = keyed_generator(self._searcher.config.seed, self._stamp_ns, "sow")
        guesses = first_guesses(self._searcher.body, self._searcher.limits, hull, rng)
        costs = self.total_costs(guesses.reshape(-1, guesses.shape[2]))
        costs = costs.reshape(guesses.shape[:2])
        best = np.argsort(costs, axis=1, kind="stable")[:, :_PER_HEADING]
        order = np.argsort(np.take_along_axis(costs, best, axis=1).ravel(), kind="stable")[
            :_INITIALISED_COUNT
        ]
        chosen = np.take_along_axis(guesses, best[:, :, None], axis=1).reshape(-1, guesses.shape[2])
        return chosen[order] if hints is None else np.concatenate([hints, chosen[order]])

    def initialised(self, guesses: FloatArray) -> Population:
        """The first population: guesses (n, p), refined."""
        return self.selected(self.refined(guesses, *_INITIALISE, spacing_m=_SPARSE_M))

    def recombined(
        self, population: Population, generation: int, *, fraction: float = 1.0
    ) -> Population:
        """The next generation.

        Args:
            population: the parents; the selection may keep them.
            generation: its number; keys the draws.
            fraction: of the full number of children.
        """
        rng = keyed_generator(
            self._searcher.config.seed, self._stamp_ns, f"generation {generation}"
        )
        children = self._recombiner.children(population.poses, round(fraction * _CHILDREN), rng)
        best = self._promising(children, population.poses, max(1, round(fraction * _REFINED)))
        refined = self.refined(best, *_RECOMBINE, spacing_m=_SPARSE_M)
        return self.selected(np.concatenate([population.poses, refined]))

    def with_exchanged_pairs(self, population: Population, generation: int) -> Population:
        """A population, and its best pose with the legs, or the arms, in each other's place.

        If such a pose costs about as much as the best one, it has children of its own first: the
        rest of the body was refined with the limbs of the best pose.

        Args:
            population: the poses.
            generation: keys the draws.
        """
        body, limits = self._searcher.body, self._searcher.limits
        for pair in PAIRS:
            if pair not in body.subspaces:
                continue
            other = in_each_others_place(body, population.poses[0], pair, limits)
            branch = self.selected(self.refined(other[None], *_EXCHANGE))
            least = self.best_cost(population)
            for number, slack in enumerate(_EXCHANGED_SLACK):
                if len(branch) and self.best_cost(branch) <= least + slack:
                    branch = self.recombined(branch, generation + number)
            population = self.selected(np.concatenate([population.poses, branch.poses]))
        return population

    def with_found(
        self, population: Population, frame: "FramePopulation", found: Population
    ) -> Population:
        """A population, and what was found in the same images with a body of another size.

        Args:
            population: the poses.
            frame, found: the other search; its poses are refined with this body.
        """
        others = scaled_to(frame._searcher.body, self._searcher.body, found.poses)
        others = self.refined(others, *_PROPAGATE)
        return self.selected(np.concatenate([population.poses, others]))

    def _promising(self, children: FloatArray, parents: FloatArray, count: int) -> FloatArray:
        """`count` of the children (n, p): the best, and the best of those that are novel."""
        order = np.argsort(self.total_costs(children), kind="stable")
        chosen = [int(i) for i in order[: count - round(_NOVEL * count)]]
        body = self._searcher.body
        points = markers_of_many(body, children)
        known = np.concatenate([markers_of_many(body, parents), points[chosen]])
        # Per child: squared distance to the nearest pose known so far.
        gaps_m2 = np.full(len(children), np.inf)
        for other in known:
            np.minimum(gaps_m2, _farthest_m2(points, other), out=gaps_m2)
        for i in map(int, order[len(chosen) :]):
            if len(chosen) == count:
                break
            if gaps_m2[i] >= _NOVEL_M**2:
                chosen.append(i)
                np.minimum(gaps_m2, _farthest_m2(points, points[i]), out=gaps_m2)
        return np.asarray(children[chosen])

    def propagated(self, population: Population, *, far: bool = False) -> Population:
        """The population of the frame before, refined in this one; `far`: after a gap in time."""
        return self.selected(self.refined(population.poses, *(_INITIALISE if far else _PROPAGATE)))

    def costs(self, poses: FloatArray) -> FloatArray:
        """1 - f_s (n,) of poses (n, p); infinite where it is undefined."""
        costs = self._costs(poses)
        return np.where(np.isfinite(costs), costs, np.inf)

    def costs_with_prior(self, poses: FloatArray) -> FloatArray:
        """`costs` plus those of unusual limbs and feet (`Searcher.unusual_costs`)."""
        return self.costs(poses) + self._searcher.unusual_costs(poses)

    def best_cost(self, population: Population) -> float:
        """1 - f_s of the best pose of a population."""
        return float(self.costs(population.poses[:1])[0])

    def total_costs(self, poses: FloatArray) -> FloatArray:
        """`costs_with_prior` and those of unusual postures (`unlike_postures`), if charged."""
        costs = self.costs_with_prior(poses)
        if self.charges_postures:
            costs += unlike_postures(self._searcher.body, poses)
        return costs

    def limb_costs(self, pose: FloatArray, limb: IntArray) -> Evaluator:
        """An evaluator of 1 - f_s (n,) for a limb's parameters (n, d), the rest held at a pose
        (p,).

        The rest of the body is rasterised once.
        """
        whole = Comparison.whole(pose, len(self._searcher.body.cone_names))
        return self._searcher.overlap_fitness.prepare(
            self._frame.views, replace(whole, active=limb)
        )

    def refined(
        self,
        poses: FloatArray,
        iterations: int,
        truncation: tuple[float, float],
        *,
        spacing_m: float = SPACING_M,
    ) -> FloatArray:
        """Poses (n, p), each refined on the contours by one thread; threads run in parallel.

        Arguments as for `refined_on_contours`.
        """
        searcher = self._searcher
        prior = pose_prior(searcher.body, _PRIOR_WEIGHT)
        threads = max(1, min(usable_threads(searcher.threads), len(poses)))
        while len(self._per_thread) < threads:
            self._per_thread.append(self.contours.with_body(searcher.body))
        out = np.array(poses)

        def work(thread: int) -> None:
            for i in range(thread, len(out), threads):
                out[i] = refined_on_contours(
                    self._per_thread[thread], out[i], searcher.config, priors=(prior,),
                    limits=searcher.limits, iterations=iterations, truncation_m=truncation,
                    standing=False, spacing_m=spacing_m,
                )  # fmt: skip

        side_by_side(work, threads)
        return out

    def selected(self, poses: FloatArray) -> Population:
        """The best poses of (n, p) that differ, at most `PER_QUARTER` per quarter of headings."""
        costs = self.total_costs(poses)
        order = [int(i) for i in np.argsort(costs, kind="stable") if np.isfinite(costs[i])]
        points = markers_of_many(self._searcher.body, poses)
        headings = {i: heading(points[i]) for i in order}
        kept: list[int] = []
        quarters = [0, 0, 0, 0]
        for i in order:
            rotation = headings[i] - headings[kept[0]] if kept else 0.0
            quarter = round(rotation / (0.5 * np.pi)) % 4
            if quarters[quarter] == PER_QUARTER:
                continue
            gaps = (np.linalg.norm(points[i] - points[j], axis=1).mean() for j in kept)
            if all(gap >= _ALIKE_M for gap in gaps):
                kept.append(i)
                quarters[quarter] += 1
        rows = np.array(kept, dtype=np.int64)
        return Population(poses[rows], costs[rows], np.array([headings[i] for i in kept]))


def scaled_to(body: BodyModel, other: BodyModel, poses: FloatArray) -> FloatArray:
    """Poses (n, p) of one body for a body of another size; the markers' mean stays in place."""
    out = poses.copy()
    at = body.root_position
    out[:, at] += (markers_of_many(body, poses) - markers_of_many(other, poses)).mean(axis=1)
    return out


def _farthest_m2(points: FloatArray, other: FloatArray) -> FloatArray:
    """Squared distance (n,) of the farthest marker between poses (n, 15, 3) and one (15, 3)."""
    apart = points - other
    return np.asarray(np.einsum("nij,nij->ni", apart, apart).max(axis=1))
