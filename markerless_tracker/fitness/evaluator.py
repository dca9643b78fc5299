"""The fitness f = f_s + f_e of SPPSO over all views, its costs, and evaluators for searches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness.arrays import Views, body_arrays, lay_out_views
from markerless_tracker.fitness.raster import (
    OUTLINE,
    SIDES,
    VISIBLE,
    EdgeRule,
    evaluate,
    make_outlines,
    make_scratch,
)
from markerless_tracker.fitness.raster.kernels import Objective
from markerless_tracker.fitness.raster.static_layer import (
    Split,
    draw_static,
    split_cones,
)
from markerless_tracker.fitness.terms import OVERLAP, PROJECTED, CostRule, view_terms
from markerless_tracker.fitness.threads import side_by_side, usable_threads, worth_waking
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Comparison, Observation

EDGE_RULES = {"sides": SIDES, "visible": VISIBLE, "outline": OUTLINE}
EDGE_TERMS = ("ssd", "mean")
COSTS = ("overlap", "bidirectional", "one_sided")
_CONE_S = 0.4e-6
"""Approximate time of one cone in one view on one thread."""


@dataclass(frozen=True)
class ViewTerms:
    """The terms of the fitness of a pose in one view.

    Attributes:
        silhouette, edges: f_s and f_e in [0, 1].
        overlap: IoU of body and silhouette.
        pixels: number of pixels in body or silhouette.
    """

    silhouette: float
    edges: float
    overlap: float
    pixels: float


class Fitness:
    """Compares poses of a body with the evidence of a rig's views.

    Args:
        body: the body.
        cameras: the cameras that may see it.
        threads: threads of an evaluation; the result does not depend on them.
        edge_rule: 'sides' samples both sides of every cone, 'visible' the parts that no nearer cone
            hides, 'outline' the parts on the outline of the whole body.
        edge_term: 'ssd': f_e = 1 - mean (1 - M)²; 'mean': f_e = mean M.
        edge_spacing_px: distance between samples along a side, which has at least four.
        edge_step_px: for 'outline', distance outward of a sample at which no cone may cover the
            pixel.
        cost: 'overlap': sum of the weights - f (SPPSO); 'bidirectional', 'one_sided': H-MCPSO's
            costs, see `Evaluator`.

    Raises:
        ConfigError: an unknown rule, term or cost.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Sequence[CameraModel],
        *,
        threads: int = 1,
        edge_rule: str = "visible",
        edge_term: str = "ssd",
        edge_spacing_px: float = 5.0,
        edge_step_px: float = 2.0,
        cost: str = "overlap",
    ) -> None:
        if edge_rule not in EDGE_RULES:
            raise ConfigError(
                f"edge_rule is {edge_rule!r}, expected one of {', '.join(EDGE_RULES)}"
            )
        if edge_term not in EDGE_TERMS:
            raise ConfigError(
                f"edge_term is {edge_term!r}, expected one of {', '.join(EDGE_TERMS)}"
            )
        if cost not in COSTS:
            raise ConfigError(f"cost is {cost!r}, expected one of {', '.join(COSTS)}")
        self.body = body
        self.cost = cost
        self.cameras = tuple(cameras)
        self.threads = usable_threads(threads)
        self._arrays = body_arrays(body)
        self._splits: dict[tuple[bytes, bytes, bytes], Split] = {}
        self._rule = EdgeRule(
            EDGE_RULES[edge_rule],
            float(edge_spacing_px),
            float(edge_step_px),
            edge_term == "ssd" or cost != "overlap",
        )
        height = max(camera.size_px[1] for camera in cameras)
        self._outlines = make_outlines(self.threads, height)
        self._scratch = make_scratch(
            self.threads,
            body.size,
            body.node_parent.size,
            len(body.cone_names),
            height,
            max((camera.size_px[0] + 63) // 64 for camera in cameras),
        )

    def lay_out(self, observations: Mapping[str, Observation]) -> Views:
        """The observations as the kernels read them; see `lay_out_views`."""
        return lay_out_views(self.cameras, observations)

    def prepare(self, views: Views, comparison: Comparison) -> "Evaluator":
        """An evaluator of a comparison's active parameters against the views of one frame."""
        return Evaluator(self, views, comparison)

    def count(
        self,
        views: Views,
        poses: FloatArray,
        silhouette_cones: NDArray[np.bool_],
        edge_cones: NDArray[np.bool_],
    ) -> FloatArray:
        """Counts (n, v, 4) of poses (n, p): see the columns of `terms`."""
        cost = CostRule(1.0, 1.0, self._rule.squared, False)
        every = np.arange(self.body.size)
        objective = self._objective(
            views, every, self.body.neutral, silhouette_cones, edge_cones, cost
        )
        return self._run(objective, poses, np.full(len(poses), np.inf))[0]

    def terms(self, views: Views, pose: FloatArray) -> dict[str, ViewTerms]:
        """f_s, f_e and overlap of one pose (p,), by camera name."""
        every = np.ones(len(self.body.cone_names), dtype=np.bool_)
        counts = self.count(views, np.ascontiguousarray(pose[None]), every, every)[0]
        found = {}
        for name, row, seen in zip(views.names, counts, views.arrays.observed, strict=True):
            silhouette, edges, overlap = view_terms(row, seen, self._rule.squared)
            covered = row[PROJECTED] + seen - row[OVERLAP]
            found[name] = ViewTerms(float(silhouette), float(edges), float(overlap), float(covered))
        return found

    def _objective(
        self,
        views: Views,
        active: NDArray[np.int64],
        centre: FloatArray,
        silhouette_cones: NDArray[np.bool_],
        edge_cones: NDArray[np.bool_],
        cost: CostRule,
    ) -> Objective:
        """The objective of points; the split into moving and static cones is cached."""
        key = (active.tobytes(), silhouette_cones.tobytes(), edge_cones.tobytes())
        if key not in self._splits:
            self._splits[key] = split_cones(
                self.body, self._arrays, active, silhouette_cones, edge_cones, self._rule
            )
        return draw_static(
            self._splits[key], views.arrays, centre, self._rule, cost, self._scratch, self._outlines
        )

    def _run(
        self, objective: Objective, points: FloatArray, cutoff_costs: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Counts (n, v, 4) and costs (n,) of points (n, d)."""
        counts = np.empty((len(points), len(objective.views.size), 4))
        costs = np.empty(len(points))
        work_s = counts[..., 0].size * objective.silhouette_cones.size * _CONE_S
        threads = self.threads if worth_waking(work_s, self.threads) else 1
        side_by_side(
            lambda thread: evaluate(
                points, cutoff_costs, objective, counts, costs, thread, threads
            ),
            threads,
        )
        return counts, costs


class Evaluator:
    """Costs of one comparison: its weighted silhouette and edge terms, averaged over the views.

    'overlap': sum of the weights - f, hence 2 - f with both weights one. H-MCPSO's costs (Saini et
    al., 2015, Eq 9) always have the squared edge term, mean (1 - M)² (Eq 10). 'one_sided' adds
    Eq 13: mean (1 - P)² over the body's pixels; with a foreground P of 0 and 1 that is the fraction
    B/(B+Y) of them that is not observed. 'bidirectional' adds ½ B/(B+Y) + ½ R/(R+Y): the paper
    prints no formula; this reading [R] is 1 - f_s, so that with the squared term it equals
    'overlap'.

    Called with points (n, d) of the active parameters, it returns costs (n,); NaN for points that
    are not finite. Cones that the active parameters do not move are drawn in the constructor.

    Attributes:
        objective: the same comparison, for compiled searches.
    """

    def __init__(self, fitness: Fitness, views: Views, comparison: Comparison) -> None:
        self._fitness = fitness
        self._comparison = comparison
        cost = CostRule(
            float(comparison.silhouette_weight),
            float(comparison.edge_weight),
            fitness._rule.squared,
            fitness.cost == "one_sided",
        )
        self.objective = fitness._objective(
            views, comparison.active, comparison.centre, comparison.silhouette_cones,
            # A term without weight is not computed.
            comparison.edge_cones & (comparison.edge_weight != 0.0), cost,
        )  # fmt: skip

    def poses(self, points: FloatArray) -> FloatArray:
        """Full poses (n, p) of points (n, d); the other parameters are those of the centre."""
        poses = np.tile(self._comparison.centre, (len(points), 1))
        poses[:, self._comparison.active] = points
        return poses

    def __call__(self, points: FloatArray, cutoff_costs: FloatArray | None = None) -> FloatArray:
        """Costs (n,) of points (n, d).

        Args:
            points: the points.
            cutoff_costs: (n,) cutoff per point: an evaluation may stop once its cost exceeds it,
                and then returns a lower bound of the cost that is at least the cutoff.
        """
        cutoff_costs = np.full(len(points), np.inf) if cutoff_costs is None else cutoff_costs
        # In another order of memory, numba would compile the evaluation once more.
        return self._fitness._run(self.objective, np.array(points, order="C"), cutoff_costs)[1]
