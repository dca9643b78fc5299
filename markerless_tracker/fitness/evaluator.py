"""The fitness f = f_s + f_e of SPPSO over all views, and the evaluators that searches call."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numba import njit
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness import kernels
from markerless_tracker.fitness.arrays import Views, body_arrays, lay_out_views
from markerless_tracker.fitness.outline import make_outlines
from markerless_tracker.fitness.threads import ONE_CALLER, usable_threads, worth_waking
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, Stage

EDGE_RULES = {"sides": kernels.SIDES, "visible": kernels.VISIBLE, "outline": kernels.OUTLINE}
EDGE_TERMS = ("ssd", "mean")
_CONE_S = 0.35e-6
"""About how long one cone in one view takes one thread."""


@dataclass(frozen=True)
class ViewTerms:
    """How well a pose explains one view: f_s and f_e in [0, 1], overlap (IoU) of silhouettes."""

    silhouette: float
    edges: float
    overlap: float


class Fitness:
    """Compares poses of a body with the evidence of a rig's views.

    Args:
        body: the body.
        cameras: the cameras that may see it.
        threads: threads of an evaluation; the result does not depend on them.
        edge_rule: 'sides' samples both sides of every cone, 'visible' those that no nearer cone
            hides, 'outline' those on the outline of the whole body.
        edge_term: 'ssd': f_e = 1 - mean (1 - M)²; 'mean': f_e = mean M.
        edge_spacing_px: distance between samples along a side (at least four a side).
        edge_step_px: how far outside a sample must be free of the body, for 'outline'.

    Raises:
        ConfigError: an unknown rule or term.
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
    ) -> None:
        if edge_rule not in EDGE_RULES:
            raise ConfigError(
                f"edge_rule is {edge_rule!r}, expected one of {', '.join(EDGE_RULES)}"
            )
        if edge_term not in EDGE_TERMS:
            raise ConfigError(
                f"edge_term is {edge_term!r}, expected one of {', '.join(EDGE_TERMS)}"
            )
        self.body = body
        self.cameras = tuple(cameras)
        self.threads = usable_threads(threads)
        self._body = body_arrays(body)
        self._rule = kernels.EdgeRule(
            EDGE_RULES[edge_rule], float(edge_spacing_px), float(edge_step_px), edge_term == "ssd"
        )
        height = max(camera.size_px[1] for camera in cameras)
        self._outlines = make_outlines(self.threads, height)
        self._scratch = kernels.make_scratch(
            self.threads,
            body.node_parent.size,
            len(body.cone_names),
            height,
            max((camera.size_px[0] + 63) // 64 for camera in cameras),
        )

    def lay_out(self, observations: Mapping[str, Observation]) -> Views:
        """The observations as the kernels read them; see `lay_out_views`."""
        return lay_out_views(self.cameras, observations)

    def prepare(self, views: Views, stage: Stage) -> "Evaluator":
        """An evaluator of one stage's parameters against the views of one frame."""
        return Evaluator(self, views, stage)

    def count(
        self,
        views: Views,
        poses: FloatArray,
        silhouette_cones: NDArray[np.bool_],
        edge_cones: NDArray[np.bool_],
    ) -> FloatArray:
        """Counts (n, v, 4) of poses (n, p): see the columns of `kernels`."""
        counts = np.empty((len(poses), len(views.names), 4))
        sampled = self.body.cone_edges & edge_cones[:, None]
        args = (
            poses, self._body, views.arrays, silhouette_cones, sampled,
            self._rule, self._scratch, self._outlines, counts,
        )  # fmt: skip
        work_s = len(poses) * len(views.names) * len(self.body.cone_names) * _CONE_S
        if not worth_waking(work_s, self.threads):
            kernels.count_serial(*args)
        else:
            with ONE_CALLER:
                numba.set_num_threads(self.threads)
                kernels.count_parallel(*args)
        return counts

    def terms(self, views: Views, pose: FloatArray) -> dict[str, ViewTerms]:
        """f_s, f_e and overlap of one pose (p,), by the names of the cameras that see."""
        every = np.ones(len(self.body.cone_names), dtype=np.bool_)
        counts = self.count(views, np.ascontiguousarray(pose[None]), every, every)
        parts = np.empty((len(views.names), 3))
        _view_terms(counts[0], views.arrays.observed, self._rule.squared, parts)
        return {
            name: ViewTerms(*map(float, row)) for name, row in zip(views.names, parts, strict=True)
        }


class Evaluator:
    """Costs of one stage: weights' sum - f, hence 2 - f with both weights one.

    Called with points (n, d) of the stage's active parameters, returns costs (n,); NaN for points
    that are not finite.
    """

    def __init__(self, fitness: Fitness, views: Views, stage: Stage) -> None:
        self._fitness = fitness
        self._views = views
        self._stage = stage
        # A term without weight is not looked at.
        self._edge_cones = stage.edge_cones & (stage.edge_weight != 0.0)

    def poses(self, points: FloatArray) -> FloatArray:
        """Full poses (n, p) of points (n, d): the other parameters stay at the stage's centre."""
        poses = np.tile(self._stage.centre, (len(points), 1))
        poses[:, self._stage.active] = points
        return poses

    def __call__(self, points: FloatArray) -> FloatArray:
        """Costs (n,) of points (n, d)."""
        stage, fitness = self._stage, self._fitness
        counts = fitness.count(
            self._views, self.poses(points), stage.silhouette_cones, self._edge_cones
        )
        costs = np.empty(len(points))
        _costs(
            counts, self._views.arrays.observed, fitness._rule.squared,
            stage.silhouette_weight, stage.edge_weight, costs,
        )  # fmt: skip
        return costs


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _view_terms(counts, observed, squared, parts):  # type: ignore[no-untyped-def]
    """Fill parts (v, 3) with f_s, f_e and the overlap of one pose from its counts (v, 4).

    f_s = ½ Y/(B+Y) + ½ Y/(R+Y) with Y in both, B projected only, R observed only. A view where the
    body is neither projected nor observed is fully explained; where it is only one of the two, not
    at all. Without edge samples f_e = 0.
    """
    for v in range(counts.shape[0]):
        both, projected = counts[v, kernels.OVERLAP], counts[v, kernels.PROJECTED]
        seen = np.float64(observed[v])
        if projected == 0.0 and seen == 0.0:
            parts[v, 0] = 1.0
            parts[v, 2] = 1.0
        elif projected == 0.0 or seen == 0.0:
            parts[v, 0] = 0.0
            parts[v, 2] = 0.0
        else:
            parts[v, 0] = 0.5 * both / projected + 0.5 * both / seen
            parts[v, 2] = both / (projected + seen - both)
        samples = counts[v, kernels.EDGE_COUNT]
        mean = counts[v, kernels.EDGE_SUM] / samples if samples > 0.0 else (1.0 if squared else 0.0)
        parts[v, 1] = 1.0 - mean if squared else mean


@njit(cache=True, nogil=True)  # type: ignore[misc]
def _costs(counts, observed, squared, silhouette_weight, edge_weight, costs):  # type: ignore[no-untyped-def]
    """Fill costs (n,) from counts (n, v, 4): the terms are averaged over the views."""
    parts = np.empty((counts.shape[1], 3))
    for n in range(counts.shape[0]):
        if not np.isfinite(counts[n, 0, 0]):
            costs[n] = np.nan
            continue
        _view_terms(counts[n], observed, squared, parts)
        f = 0.0
        for v in range(counts.shape[1]):
            f += silhouette_weight * parts[v, 0] + edge_weight * parts[v, 1]
        costs[n] = silhouette_weight + edge_weight - f / counts.shape[1]
