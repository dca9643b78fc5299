"""Contour evidence of a frame, and the normal equations that contour refinement solves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.arrays import BodyArrays, Views, body_arrays
from markerless_tracker.fitness.contour import kernels
from markerless_tracker.fitness.contour.kernels import ContourViews, Residuals
from markerless_tracker.fitness.contour.outline_samples import Samples, make_samples
from markerless_tracker.fitness.raster.outline import Outlines, make_outlines
from markerless_tracker.fitness.threads import ONE_CALLER, usable_threads, worth_waking
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

SPACING_M = 0.02
"""Distance of outline points along the body's outline."""
_VIEW_S = 0.07e-3
"""About how long the equations of one view take one thread."""
_SMALLEST_EDGE_PX = 12
_LEAST_MARGIN_PX = 24

Mapper = Callable[..., "object"]


@dataclass(frozen=True, eq=False)
class SilhouetteContour:
    """The edge of one silhouette.

    Attributes:
        distance: (h, w) float32 signed distance to the edge, px, positive outside, of a window.
        left, top: the window's first column and row in the frame.
        points, normals: (n, 2) px, points of the edge and the outward directions there.
        spacing: (n,) px of edge that each point stands for.
    """

    distance: NDArray[np.float32]
    left: int
    top: int
    points: FloatArray
    normals: FloatArray
    spacing: FloatArray


def edge_of_mask(observation: Observation, spacing_px: float) -> SilhouetteContour:
    """Signed distances around a silhouette, and points along its edge.

    The window is the silhouette's bounding box and a margin of a sixth of its height. The edge
    runs midway between pixels inside and outside; where the silhouette leaves the frame, and
    around specks, there are no points.
    """
    mask = observation.in_full_frame(observation.mask.view(np.uint8))
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size == 0:
        nothing = np.empty((0, 2))
        return SilhouetteContour(np.empty((0, 0), np.float32), 0, 0, nothing, nothing, np.empty(0))
    margin = max(_LEAST_MARGIN_PX, (rows[-1] - rows[0]) // 6)
    top, bottom = max(0, rows[0] - margin), min(height, rows[-1] + margin + 1)
    left, right = max(0, columns[0] - margin), min(width, columns[-1] + margin + 1)
    window = np.ascontiguousarray(mask[top:bottom, left:right])
    inside = cv2.distanceTransform(window, cv2.DIST_L2, 5)
    distance = np.asarray(cv2.distanceTransform(1 - window, cv2.DIST_L2, 5), np.float32)
    # The edge runs midway between pixels inside and outside.
    distance -= inside
    distance += window
    distance -= 0.5
    contours, _ = cv2.findContours(window, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    chains: list[NDArray[Any]] = [np.empty((0, 2), dtype=np.int32)]
    spacing = [np.empty(0)]
    for contour in contours:
        if len(contour) < _SMALLEST_EDGE_PX:
            continue
        whole = cv2.arcLength(contour, closed=True)
        kept = contour[:: max(1, round(spacing_px * len(contour) / whole)), 0]
        chains.append(kept)
        spacing.append(np.full(len(kept), whole / len(kept)))
    chain = np.concatenate(chains)
    at = chain + (left, top)
    normal = np.empty(at.shape)
    kernels.steepest(distance, chain, normal)
    length = np.linalg.norm(normal, axis=1)
    inner = (at > 0).all(axis=1) & (at < (width - 1, height - 1)).all(axis=1) & (length > 0)
    normal = normal[inner] / length[inner, None]
    return SilhouetteContour(
        distance,
        int(left),
        int(top),
        at[inner] + 0.5 * normal,
        normal,
        np.concatenate(spacing)[inner],
    )


def join_edges(edges: Sequence[SilhouetteContour]) -> ContourViews:
    """The edges of several views as the kernels read them."""
    sizes = [edge.distance.size for edge in edges]
    counts = [len(edge.points) for edge in edges]
    return ContourViews(
        distance=np.concatenate([edge.distance.ravel() for edge in edges]),
        distance_start=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        window=np.array([[e.left, e.top, *e.distance.shape[::-1]] for e in edges], dtype=np.int64),
        points=np.concatenate([edge.points for edge in edges]),
        normals=np.concatenate([edge.normals for edge in edges]),
        spacing=np.concatenate([edge.spacing for edge in edges]),
        point_start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sums over all residuals r (m) of one pose, weighted by outline length (m) and robustly.

    Attributes:
        hessian: (p, p) JᵀWJ.
        slope: (p,) JᵀWr.
        cost: sum of length times the robust cost of r, m³.
    """

    hessian: FloatArray
    slope: FloatArray
    cost: float


class ContourFrame:
    """One frame's contour evidence, ready to be compared with poses of a body.

    Args:
        body: the body.
        cameras: cameras by name.
        observations: the evidence of the views, by camera name.
        views: the same views as laid out for the silhouettes' kernels.
        threads: 1, or more for a thread a view; the result does not depend on it.
        pixels_per_m: size of a metre at the body, px, by camera name.
        step_px: how far outside an outline point must be free of the body.
        mapper: `map`, or a thread pool's.
    """

    def __init__(
        self,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        observations: Mapping[str, Observation],
        views: Views,
        *,
        pixels_per_m: Mapping[str, float],
        threads: int = 1,
        step_px: float = 2.0,
        mapper: Callable[..., object] = map,
    ) -> None:
        self.body = body
        self.views = views
        self._arrays: BodyArrays = body_arrays(body)
        self._threads = usable_threads(threads)
        self._step_px = step_px

        def edge(name: str) -> SilhouetteContour:
            return edge_of_mask(observations[name], SPACING_M * pixels_per_m[name])

        self.contours = join_edges(list(mapper(edge, views.names)))  # type: ignore[call-overload]
        count = len(views.names)
        most = int(np.diff(self.contours.point_start).max())
        self.samples: Samples = make_samples(count)
        self.residuals: Residuals = kernels.make_residuals(count, most)
        height = int(views.arrays.size[:, 1].max())
        self._outlines: Outlines = make_outlines(count, height)
        self._scratch = kernels.make_contour_scratch(
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
        return NormalEquations(s.hessian.copy(), s.slope.copy(), float(self.residuals.cost.sum()))

    def collect(self, pose: FloatArray, truncation_m: float, body: BodyModel | None = None) -> None:
        """Fill `samples` and `residuals` at a pose (p,), of another body's shape if given."""
        arrays = self._arrays if body is None else body_arrays(body)
        args = (
            np.ascontiguousarray(pose, dtype=np.float64), arrays, self.views.arrays, self.contours,
            SPACING_M, self._step_px, truncation_m, self.samples, self.residuals, self._scratch,
            self._outlines,
        )  # fmt: skip
        if not worth_waking(len(self.views.names) * _VIEW_S, self._threads):
            kernels.equations_serial(*args)
            return
        with ONE_CALLER:
            numba.set_num_threads(self._threads)
            kernels.equations_parallel(*args)
