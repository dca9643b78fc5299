"""Contour evidence of a frame, and the normal equations that contour refinement solves."""

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.arrays import BodyArrays, Views, body_arrays
from markerless_tracker.fitness.contour.equations import descend, make_contour_scratch
from markerless_tracker.fitness.contour.outline_samples import Samples, make_samples
from markerless_tracker.fitness.contour.residuals import Residuals, make_residuals
from markerless_tracker.fitness.contour.silhouette_contour import (
    SilhouetteContour,
    join_edges,
    silhouette_contour,
    some_edges,
)
from markerless_tracker.fitness.raster import Outlines, make_outlines
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior
from markerless_tracker.optim.gauss_newton import truncations
from markerless_tracker.records import Observation

SPACING_M = 0.02
"""Distance of neighbouring outline points along the outline, m."""
RADIUS_M = 0.3
"""Default distance from a silhouette up to which outlines are compared, m."""
_NO_BOUNDS = np.empty((2, 0))


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sums over all residuals r (m) of one pose; weights W are outline length (m) x robust weight.

    Attributes:
        hessian: (p, p) JᵀWJ.
        gradient: (p,) JᵀWr.
        cost: sum of length times the robust cost of r, m³.
    """

    hessian: FloatArray
    gradient: FloatArray
    cost: float


class ContourFrame:
    """One frame's contour evidence, ready to be compared with poses of a body.

    Args:
        body: the body.
        cameras: cameras by name.
        observations: the evidence of the views, by camera name.
        views: the same views, laid out by `lay_out_views`.
        pixels_per_m: size of a metre at the body, px, by camera name.
        radius_m: distance from a silhouette, at the body, beyond which outlines are outliers
            in any case.
        step_px: distance outward of an outline point at which no cone may cover the pixel.
        mapper: `map`, or one that uses threads; applied to the views.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        observations: Mapping[str, Observation],
        views: Views,
        *,
        pixels_per_m: Mapping[str, float],
        step_px: float = 2.0,
        radius_m: float = RADIUS_M,
        mapper: Callable[..., object] = map,
    ) -> None:
        self.body = body
        self.views = views
        self._arrays: BodyArrays = body_arrays(body)
        self._step_px = step_px

        def edge(name: str) -> SilhouetteContour:
            scale = pixels_per_m[name]
            return silhouette_contour(observations[name], SPACING_M * scale, radius_m * scale)

        self.contours = join_edges(list(mapper(edge, views.names)))  # type: ignore[call-overload]
        self._allocate()

    def with_body(self, body: BodyModel) -> "ContourFrame":
        """The same evidence for a body of the same kind, with its own working memory.

        Two such frames can be used at the same time.
        """
        other = copy.copy(self)
        other.body, other._arrays = body, body_arrays(body)
        other._allocate()
        return other

    def seen_by(self, cameras: Sequence[CameraModel], body: BodyModel) -> "ContourFrame":
        """The views of some cameras, at least one, as these are calibrated, for a body of the same
        kind, with its own working memory.
        """
        other = copy.copy(self)
        other.body, other._arrays = body, body_arrays(body)
        other.views = self.views.seen_by(cameras)
        other.contours = some_edges(
            self.contours, [self.views.names.index(name) for name in other.views.names]
        )
        other._allocate()
        return other

    def _allocate(self) -> None:
        """Allocate the working memory."""
        body, views = self.body, self.views
        count = len(views.names)
        most = int(np.diff(self.contours.point_start).max())
        self.samples: Samples = make_samples(count)
        self.residuals: Residuals = make_residuals(count, most)
        height = int(views.arrays.size[:, 1].max())
        self._outlines: Outlines = make_outlines(count, height)
        self._scratch = make_contour_scratch(
            count,
            body.node_parent.size,
            body.size,
            height,
            int(views.arrays.words.max()),
        )

    def equations(self, pose: FloatArray, truncation_m: float) -> NormalEquations:
        """Normal equations at a pose (p,); residuals beyond `truncation_m` are outliers."""
        self.collect(pose, truncation_m)
        s = self._scratch
        return NormalEquations(
            s.hessian.copy(), s.gradient.copy(), float(self.residuals.cost.sum())
        )

    def collect(self, pose: FloatArray, truncation_m: float, body: BodyModel | None = None) -> None:
        """Fill `samples` and `residuals` at a pose (p,), with another body's shape if given."""
        arrays = self._arrays if body is None else body_arrays(body)
        none = np.empty((0, pose.size))
        truncations_m = np.array([truncation_m])
        self._descend(
            pose, 0, truncations_m, 1.0, none, none, _NO_BOUNDS, 0.0, False, arrays, SPACING_M
        )

    def refined(
        self,
        start: FloatArray,
        *,
        precision: float,
        priors: tuple[Prior, ...],
        bounds: FloatArray,
        iterations: int,
        truncation_m: tuple[float, float],
        floor_precision: float = 0.0,
        standing: bool = True,
        spacing_m: float = SPACING_M,
    ) -> FloatArray:
        """A pose (p,) refined as by `optim.refine`, in one compiled call.

        Args:
            start: (p,) initial pose.
            precision: factor from these normal equations to those of -log p, 1 / m³.
            priors, bounds, iterations: as for `optim.refine`.
            truncation_m: residuals beyond it are outliers, in the first and in the last step.
            floor_precision: of each part below z = 0 (`floor`), 1 / m²; 0 for no floor.
            standing: whether the ankles' heights are used.
            spacing_m: distance of neighbouring outline points along the outline.
        """
        mean = np.array([prior.mean for prior in priors]).reshape(-1, start.size)
        weight = np.array([prior.precision for prior in priors]).reshape(-1, start.size)
        truncations_m = truncations(*truncation_m, iterations)
        begin = np.clip(start, *bounds)
        return self._descend(
            begin, iterations, truncations_m, precision, mean, weight, bounds, floor_precision,
            standing, self._arrays, spacing_m,
        )  # fmt: skip

    def _descend(
        self,
        pose: FloatArray,
        steps: int,
        truncations_m: FloatArray,
        precision: float,
        mean: FloatArray,
        weight: FloatArray,
        bounds: FloatArray,
        floor_precision: float,
        standing: bool,
        arrays: BodyArrays,
        spacing_m: float,
    ) -> FloatArray:
        """The pose (p,) after `equations.descend`; same arguments."""
        pose = np.array(pose, dtype=np.float64)
        bounds = np.array(bounds, dtype=np.float64)
        descend(
            pose, steps, truncations_m, precision, mean, weight, bounds, floor_precision,
            standing, arrays, self.views.arrays, self.contours, spacing_m, self._step_px,
            self.samples, self.residuals, self._scratch, self._outlines,
        )  # fmt: skip
        return pose
