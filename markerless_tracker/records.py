"""Frozen values that cross rooms: evidence of one image, one stage of a search, one result."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import SearchError
from markerless_tracker.observation import (
    MaskWords,
    Observation,
    locked,
    pack_mask,
    unpack_mask,
)

__all__ = [
    "CONTOUR",
    "Comparison",
    "Confidence",
    "LimbState",
    "MaskWords",
    "Observation",
    "SearchPlan",
    "Stage",
    "TrackResult",
    "TrackState",
    "locked",
    "pack_mask",
    "unpack_mask",
]

CONTOUR = "contour"
"""The algorithm of a stage that refines on contours instead of evaluating particles."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The comparison of a search, for a pose of p parameters and a body of c cones.

    Attributes:
        active: (d,) indices of the parameters that vary.
        centre: (p,) pose; the other parameters are held at it.
        silhouette_weight, edge_weight: weights of f_s and f_e.
        silhouette_cones, edge_cones: (c,) cones that each term uses.

    Raises:
        SearchError: the centre is no pose, or an active parameter is not in it.
    """

    active: NDArray[np.int64]
    centre: NDArray[np.float64]
    silhouette_weight: float
    edge_weight: float
    silhouette_cones: NDArray[np.bool_]
    edge_cones: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, dtype in (
            ("active", np.int64),
            ("centre", np.float64),
            ("silhouette_cones", np.bool_),
            ("edge_cones", np.bool_),
        ):
            object.__setattr__(self, name, locked(getattr(self, name), dtype))
        if self.centre.ndim != 1:
            raise SearchError(f"comparison: centre is {self.centre.shape}, expected (p,)")
        if self.active.size == 0 or self.active.min() < 0 or self.active.max() >= self.centre.size:
            raise SearchError(
                f"comparison: active parameters are {self.active.tolist()}, expected some of "
                f"0..{self.centre.size - 1}"
            )

    @classmethod
    def whole(
        cls,
        centre: NDArray[np.float64],
        cones: int,
        *,
        silhouette_weight: float = 1.0,
        edge_weight: float = 0.0,
    ) -> "Comparison":
        """All parameters of a pose (p,) vary, and both terms use all cones of the body."""
        every = np.ones(cones, dtype=np.bool_)
        active = np.arange(len(centre))
        return cls(active, centre, silhouette_weight, edge_weight, every, every)


@dataclass(frozen=True, eq=False)
class SearchPlan:
    """How a search for a pose of p parameters proceeds.

    Attributes:
        algorithm: registered name of the optimiser, or 'contour' for contour refinement.
        sigma: (p,) standard deviation of the first sample in m or rad; only the active ones are
            read. For 'contour' that of the prior about the centre.
        particles: particles per iteration; 0 for 'contour'.
        iterations: number of iterations; the initial sample of a swarm is the first.
        min_improvement: where stages compete, a result is taken if f rises by more than this.
        options: the algorithm's own settings by name.

    Raises:
        SearchError: there is no budget.
    """

    algorithm: str
    sigma: NDArray[np.float64]
    particles: int
    iterations: int
    min_improvement: float = 0.0
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", locked(self.sigma, np.float64))
        if self.particles < (0 if self.algorithm == CONTOUR else 1) or self.iterations < 1:
            raise SearchError(
                f"{self.algorithm}: {self.particles} particles x {self.iterations} iterations, "
                "expected at least 1 of each"
            )

    @property
    def evaluations(self) -> int:
        """Evaluations that the search spends."""
        return self.particles * self.iterations


@dataclass(frozen=True, eq=False)
class Stage:
    """One search of a frame.

    Attributes:
        name: distinct within a frame; keys the random draws.
        comparison: what is compared; its centre is where the search starts.
        plan: how it is searched.

    Raises:
        SearchError: comparison and plan are for poses of different sizes.
    """

    name: str
    comparison: Comparison
    plan: SearchPlan

    def __post_init__(self) -> None:
        centre, sigma = self.comparison.centre, self.plan.sigma
        if sigma.shape != centre.shape:
            raise SearchError(
                f"stage {self.name}: centre {centre.shape} and sigma {sigma.shape} "
                "must be (p,) both"
            )

    def centred(self, pose: NDArray[np.float64]) -> "Stage":
        """The same stage from another pose (p,)."""
        return replace(self, comparison=replace(self.comparison, centre=pose))

    def planned(self, **changes: Any) -> "Stage":
        """The same stage with attributes of its plan changed."""
        return replace(self, plan=replace(self.plan, **changes))


class TrackState(Enum):
    """State of a track."""

    SEARCHING = "SEARCHING"
    TRACKING = "TRACKING"
    LOST = "LOST"


@dataclass(frozen=True)
class LimbState:
    """State of the track of one limb.

    Attributes:
        state: TRACKING or LOST.
        inside_fraction: fraction of the limb's axis inside the silhouettes, mean over the views;
            NaN if it lies outside all frames.
        particle_sd_ratio: standard deviation of the swarm's particles after the last iteration
            over that of the first sample; NaN without a swarm.
    """

    state: TrackState
    inside_fraction: float
    particle_sd_ratio: float


@dataclass(frozen=True, eq=False)
class Confidence:
    """Uncertainty of a pose of p parameters: standard deviations, in m and rad.

    Attributes:
        pose_sd: (p,) of each parameter.
        markers_sd_m: (15, 3) of each marker, along the world's axes.
        root_covariance: (6, 6) of the root frame: x, y, z, and small rotations about the
            world's x, y and z axis.
        pose_covariance: (p, p) of the parameters; `pose_sd` are the roots of its diagonal. None =
            only the standard deviations are known.
    """

    pose_sd: NDArray[np.float64]
    markers_sd_m: NDArray[np.float64]
    root_covariance: NDArray[np.float64]
    pose_covariance: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for name in ("pose_sd", "markers_sd_m", "root_covariance", "pose_covariance"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, locked(getattr(self, name), np.float64))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(p, p) covariance of the parameters; diagonal if only the deviations are known."""
        if self.pose_covariance is not None:
            return self.pose_covariance
        return np.diag(self.pose_sd**2)


@dataclass(frozen=True, eq=False)
class TrackResult:
    """The result of `Tracker.step` for one set of images.

    Attributes:
        stamp_ns: time of the images.
        state: state after this frame.
        pose: (p,) parameters in m and rad, or None when there is no estimate.
        markers_m: (15, 3) marker positions, world frame, or None.
        fitness: f = f_s + f_e in [0, 2] of the estimate (NaN without one).
        iou: per camera, overlap (IoU) of the silhouette and the projected body.
        evaluations: evaluations of the objective that the swarms spent on this frame.
        refinements: iterations of contour refinement spent on this frame.
        effort: as given to `Tracker.step`.
        observations: the evidence of each camera.
        warnings: messages for the user about this frame, one line each.
        confidence: uncertainty of the pose; None without contour refinement.
        limbs: state of each limb; empty without an estimate.
        exposure: per camera with an image, its brightness relative to its background, by channel.
        settling: whether the automatic start needs further sets that are near to this one in time.
    """

    stamp_ns: int
    state: TrackState
    pose: NDArray[np.float64] | None
    markers_m: NDArray[np.float64] | None
    fitness: float
    iou: Mapping[str, float]
    evaluations: int
    refinements: int = 0
    effort: float = 1.0
    observations: Mapping[str, Observation] = field(default_factory=dict, repr=False)
    warnings: tuple[str, ...] = ()
    confidence: Confidence | None = None
    limbs: Mapping[str, LimbState] = field(default_factory=dict)
    exposure: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    settling: bool = False

    def __post_init__(self) -> None:
        for name in ("pose", "markers_m"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, locked(value, np.float64))
