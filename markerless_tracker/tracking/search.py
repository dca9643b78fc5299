"""The search of one frame: runs its stages, each from the estimate of the one before it."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel, Feasibility
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness import Fitness, Views, ViewTerms
from markerless_tracker.fitness.contour import RADIUS_M, ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import (
    ALGORITHMS,
    ParticleSet,
    Prior,
    Problem,
    is_replaced,
    keyed_generator,
)
from markerless_tracker.records import CONTOUR, Comparison, Observation, SearchPlan, Stage
from markerless_tracker.tracking.candidates.posture_costs import off_floor
from markerless_tracker.tracking.candidates.prior_costs import prior_costs
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.refinement import pose_prior, refined_on_contours
from markerless_tracker.tracking.swarms import SWARMS, SwarmSearch

_NEAREST_M = 0.5
LIMB_TRUNCATION_M = 0.12
"""Truncation in the first step of the refinement of a limb that is searched elsewhere."""
RADIUS_FACTOR = 1.3
"""Outlines of a tracked body are compared up to this multiple of the largest truncation, since
limbs may be nearer to a camera than the pelvis."""


def make_fitness(
    body: BodyModel, rig: CameraRig, config: TrackerConfig, *, threads: int = 1
) -> Fitness:
    """The fitness of a body in a rig's views, with the terms of a configuration."""
    return Fitness(
        body,
        rig.cameras,
        threads=threads,
        edge_rule=config.edges.rule,
        edge_term=config.edges.term,
        edge_spacing_px=config.edges.spacing_px,
        edge_step_px=config.edges.step_px,
        cost=config.cost,
    )


class Searcher:
    """Makes the searches of frames with one body.

    Args:
        rig: the cameras.
        body: the body with the person's shape.
        config: settings.
        limits: (2, p) joint limits.
        threads: threads of the fitness; results do not depend on them.
        mapper: `map`, or one that uses threads.
    """

    def __init__(
        self,
        rig: CameraRig,
        body: BodyModel,
        config: TrackerConfig,
        *,
        limits: FloatArray,
        threads: int,
        mapper: Callable[..., object] = map,
    ) -> None:
        self.body = body
        self.config = config
        self.limits = limits
        self.threads = threads
        # A pool of one thread gains nothing.
        self.mapper = mapper if threads > 1 else map
        self.cameras: Mapping[str, CameraModel] = {camera.name: camera for camera in rig}
        self.feasible = Feasibility(body, limits, config.collision)
        self.fitness = make_fitness(body, rig, config, threads=threads)
        # Starts and limbs' searches compare 1 - f_s, whatever the swarms minimise.
        self.overlap_fitness = self.fitness
        if config.cost != "overlap":
            plain = replace(config, cost="overlap")
            self.overlap_fitness = make_fitness(body, rig, plain, threads=threads)
        self.tracked_radius_m = RADIUS_FACTOR * max(config.refine.truncation_m, LIMB_TRUNCATION_M)
        self.particle_sets: dict[str, ParticleSet] = {}
        """By stage, the particles of the last frame, if its algorithm continues from them."""

    def unusual_costs(self, poses: FloatArray) -> FloatArray:
        """Costs (n,) of unusual limbs and, with a floor, of feet off it, in units of f_s."""
        costs = prior_costs(self.body, poses)
        if self.config.refine.floor_sd_m > 0.0:
            costs += off_floor(self.body, poses)
        return costs

    def frame(
        self,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        predicted: FloatArray,
        *,
        limits: FloatArray | None = None,
        radius_m: float = RADIUS_M,
    ) -> "FrameSearch":
        """The search of one frame; arguments as of `FrameSearch`."""
        return FrameSearch(self, observations, stamp_ns, predicted, limits, radius_m)


SearcherFor = Callable[[BodyModel], Searcher]
"""Makes a searcher of a body."""


def make_searcher(
    body: BodyModel,
    *,
    rig: CameraRig,
    config: TrackerConfig,
    threads: int,
    mapper: Callable[..., object] = map,
) -> Searcher:
    """A searcher with the joint limits of the configuration; arguments as of `Searcher`."""
    limits = joint_limits(body, config)
    return Searcher(rig, body, config, limits=limits, threads=threads, mapper=mapper)


class FrameSearch:
    """The search of one frame.

    Args:
        searcher: the body, the cameras and the settings.
        observations: the evidence, by camera name.
        stamp_ns: time of the frame; keys the draws, together with the seed.
        predicted: (p,) centre of the search.
        limits: (2, p) of the pose, which may be narrower than the joint limits; None = the joint
            limits.
        radius_m: distance from a silhouette, at the body, beyond which outlines are outliers
            in any case.

    Attributes:
        searcher, observations, stamp_ns: the arguments.
        pose: (p,) the estimate so far.
        evaluations, refinements: numbers of evaluations and refinement iterations spent.
        cost: of the estimate, 1 - f, after `run` with a refinement; else infinite.
        particle_sd_ratio: (p,) standard deviation of the particles over that of the first sample,
            in the last swarm that varied a parameter; NaN without such a swarm.
    """

    def __init__(
        self,
        searcher: Searcher,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        predicted: FloatArray,
        limits: FloatArray | None = None,
        radius_m: float = RADIUS_M,
    ) -> None:
        self._radius_m = radius_m
        self._limits = searcher.limits if limits is None else limits
        self.pose = predicted if limits is None else np.clip(predicted, *limits)
        self._predicted = predicted
        self.evaluations = 0
        self.refinements = 0
        self.cost = np.inf
        self.particle_sd_ratio = np.full(searcher.body.size, np.nan)
        self.searcher = searcher
        self.observations = observations
        self.stamp_ns = stamp_ns
        self._views = searcher.fitness.lay_out(observations)
        self._contours: ContourFrame | None = None
        self._terms: tuple[FloatArray, dict[str, ViewTerms]] | None = None
        self._whole: Comparison | None = None
        self._costs_of: Callable[[FloatArray], FloatArray] | None = None

    @property
    def views(self) -> Views:
        """The evidence in the layout of the fitness."""
        return self._views

    @property
    def contours(self) -> ContourFrame:
        """The frame's contour evidence, made on first use."""
        if self._contours is None:
            searcher = self.searcher
            self._contours = ContourFrame(
                searcher.body,
                searcher.cameras,
                self.observations,
                self._views,
                pixels_per_m=self._pixels_per_m(),
                step_px=searcher.config.edges.step_px,
                radius_m=self._radius_m,
                mapper=searcher.mapper,
            )
        return self._contours

    def run(self, stages: tuple[Stage, ...]) -> FloatArray:
        """Run stages from the estimate so far; returns the new estimate (p,).

        Without contour refinement the result is the best of the last swarm, as published. If there
        is contour refinement, in this call or an earlier one, a stage's result is taken only if it
        explains the views better, by at least `min_improvement` of the stage, and a swarm's only if
        it also gains more than it is less usual. The swarm corrects a refinement at a wrong
        optimum; the refinement improves the swarm's precision.
        """
        contour = next((stage for stage in stages if stage.plan.algorithm == CONTOUR), None)
        if contour is not None and self._whole is None:
            # A contour stage uses every parameter and every cone.
            self._whole = contour.comparison
            self._costs_of = self.searcher.fitness.prepare(self._views, self._whole)
            self.cost = float(self._costs_of(self.pose[None])[0])
        for stage in stages:
            found_cost = None
            if stage.plan.algorithm == CONTOUR:
                found = self._refine(stage.plan)
            else:
                found, own_cost = self._swarm(stage.centred(self.pose))
                if self._whole is not None and _same_terms(stage.comparison, self._whole):
                    found_cost = own_cost
            if self._costs_of is None:
                self.pose = found
                continue
            if found_cost is None:
                found_cost = float(self._costs_of(found[None])[0])
            gain = self.cost - found_cost
            better = gain > stage.plan.min_improvement
            if better and stage.plan.algorithm != CONTOUR:
                before, after = self.searcher.unusual_costs(np.stack([self.pose, found]))
                better = gain > float(after - before)
            if better:
                self.pose, self.cost = found, found_cost
        return self.pose

    def take(self, pose: FloatArray) -> None:
        """Take a pose (p,) that was found otherwise as the estimate."""
        if self._costs_of is not None and not np.array_equal(pose, self.pose):
            self.cost = float(self._costs_of(pose[None])[0])
        self.pose = pose

    def terms(self) -> dict[str, ViewTerms]:
        """The terms of the fitness of the estimate in each view."""
        if self._terms is None or not np.array_equal(self._terms[0], self.pose):
            self._terms = self.pose.copy(), self.searcher.fitness.terms(self._views, self.pose)
        return self._terms[1]

    def _swarm(self, stage: Stage) -> tuple[FloatArray, float | None]:
        """The pose (p,) found by a swarm, and its cost if known."""
        searcher, plan = self.searcher, stage.plan
        rng = keyed_generator(searcher.config.seed, self.stamp_ns, stage.name)
        if plan.algorithm not in SWARMS or is_replaced(plan.algorithm):
            return self._uncompiled(stage, rng), None
        active, centre = stage.comparison.active, stage.comparison.centre
        search = SwarmSearch(
            centre=centre[active],
            sigma=plan.sigma[active],
            bounds=np.ascontiguousarray(self._limits[:, active]),
            count=plan.particles,
            iterations=plan.iterations,
            rng=rng,
            constraints=searcher.feasible.constraints(active, centre, forgive=self._forgiving),
            objective=searcher.fitness.prepare(self._views, stage.comparison).objective,
        )
        particles = SWARMS[plan.algorithm](search, **plan.options)
        self._note(stage, plan.evaluations, particles.best.std(axis=0))
        pose = centre.copy()
        # SPPSO's particles keep the joint limits, but not the narrower ones.
        pose[active] = np.clip(particles.found, *search.bounds)
        cost = float(particles.found_cost[0])
        same = np.array_equal(pose[active], particles.found)
        return pose, cost if same and np.isfinite(cost) else None

    def _uncompiled(self, stage: Stage, rng: np.random.Generator) -> FloatArray:
        """The pose (p,) found by an algorithm that is not compiled as a whole."""
        searcher, plan = self.searcher, stage.plan
        active, centre = stage.comparison.active, stage.comparison.centre
        evaluator = searcher.fitness.prepare(self._views, stage.comparison)
        problem = Problem(
            bounds=self._limits[:, active],
            centre=centre[active],
            sigma=plan.sigma[active],
            particles=plan.particles,
            iterations=plan.iterations,
            feasible=searcher.feasible.around(active, centre, forgive=self._forgiving),
            rng=rng,
            memory=searcher.particle_sets.get(stage.name),
        )
        optimizer = ALGORITHMS[plan.algorithm](problem, **plan.options)
        best = optimizer.run(evaluator, early=True)
        self._note(stage, optimizer.evaluations, optimizer.particle_sd)
        if optimizer.memory is not None:
            searcher.particle_sets[stage.name] = optimizer.memory
        return np.asarray(evaluator.poses(best[None])[0])

    @property
    def _forgiving(self) -> bool:
        """Whether collisions that the centre already has are allowed."""
        return self.searcher.config.collision == "elliptic"

    def _note(self, stage: Stage, evaluations: int, sd: FloatArray) -> None:
        """Note the evaluations of a swarm and the standard deviation (d,) of its particles."""
        active = stage.comparison.active
        self.evaluations += evaluations
        with np.errstate(invalid="ignore", divide="ignore"):
            self.particle_sd_ratio[active] = sd / stage.plan.sigma[active]

    def _refine(self, plan: SearchPlan) -> FloatArray:
        """The pose (p,) after a contour refinement from the estimate so far."""
        searcher, config = self.searcher, self.searcher.config
        self.refinements += plan.iterations
        return refined_on_contours(
            self.contours,
            self.pose,
            config,
            priors=(
                Prior(self._predicted, 1.0 / plan.sigma**2),
                pose_prior(searcher.body, at=self._predicted),
            ),
            limits=self._limits,
            iterations=plan.iterations,
            truncation_m=(config.refine.truncation_m, config.refine.truncation_end_m),
        )

    def _pixels_per_m(self) -> dict[str, float]:
        """Size of a metre at the body in each view, px."""
        searcher = self.searcher
        at = root_m(searcher.body, self.pose)
        return {name: pixels_per_m(searcher.cameras[name], at) for name in self._views.names}


def _same_terms(one: Comparison, other: Comparison) -> bool:
    """Whether two comparisons give a pose the same cost."""
    weights = [(c.silhouette_weight, c.edge_weight) for c in (one, other)]
    sampled = one.edge_weight == 0.0 or np.array_equal(one.edge_cones, other.edge_cones)
    drawn = np.array_equal(one.silhouette_cones, other.silhouette_cones)
    return weights[0] == weights[1] and sampled and drawn


def root_m(body: BodyModel, pose: FloatArray) -> FloatArray:
    """Position (3,) of the root of a body at a pose (p,), m, world frame."""
    return pose[body.root_position]


def pixels_per_m(camera: CameraModel, point_m: FloatArray) -> float:
    """Size of a metre at a point (3,) of the world in a camera's image, px."""
    depth = float(camera.T_cam_world[2, :3] @ point_m + camera.T_cam_world[2, 3])
    return float(camera.matrix[0, 0]) / max(depth, _NEAREST_M)
