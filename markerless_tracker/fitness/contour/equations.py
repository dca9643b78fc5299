"""A pose in, residuals and normal equations out: all views, one thread a view or all on one."""

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, kernel
from markerless_tracker.fitness.contour.chain_kernels import SUMS, add_wrench, sum_chain
from markerless_tracker.fitness.contour.nearest import BAND_PX
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES, sample_outline
from markerless_tracker.fitness.contour.residuals import collect_residuals
from markerless_tracker.fitness.raster.kernels import cone_ends
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.geometry import FloatArray


class ContourScratch(NamedTuple):
    """Working memory, per view: m nodes (once), c cones, frames of h rows of w words."""

    nodes: FloatArray  # (m, 3, 4)
    world: FloatArray  # (18 * LANES,), rows as of Outlines.ends
    bits: NDArray[np.uint64]  # (v, w * h), zero between calls
    used: NDArray[np.int64]  # (v, w, 2)
    start: NDArray[np.int64]  # (v, h / BAND_PX + 2)
    order: NDArray[np.int64]  # (v, MAX_SAMPLES)
    sums: FloatArray  # (v, m, SUMS)
    hessian: FloatArray  # (p, p)
    slope: FloatArray  # (p,)


def make_contour_scratch(
    views: int, nodes: int, parameters: int, height: int, words: int
) -> ContourScratch:
    """Allocate working memory."""
    return ContourScratch(
        np.empty((nodes, 3, 4)),
        np.ones(18 * LANES),
        np.zeros((views, words * height), dtype=np.uint64),
        np.empty((views, words, 2), dtype=np.int64),
        np.empty((views, height // BAND_PX + 2), dtype=np.int64),
        np.empty((views, MAX_SAMPLES), dtype=np.int64),
        np.empty((views, nodes, SUMS)),
        np.empty((parameters, parameters)),
        np.empty(parameters),
    )


@kernel
def _accumulate(view, cone_node, samples, residuals, sums):  # type: ignore[no-untyped-def]
    """Sum one view's residuals per node of the body, into sums (m, SUMS)."""
    for m in range(sums.shape[0]):
        for k in range(SUMS):
            sums[m, k] = 0.0
    world, cone = samples.world[view], samples.cone[view]
    gradient, sample = residuals.gradient[view], residuals.sample[view]
    weight, value = residuals.weight[view], residuals.value[view]
    for n in range(residuals.count[view]):
        s = sample[n]
        add_wrench(
            world[s, 0], world[s, 1], world[s, 2], gradient[n, 0], gradient[n, 1], gradient[n, 2],
            weight[n], value[n], sums, cone_node[cone[s]],
        )  # fmt: skip


@kernel
def _one_view(  # type: ignore[no-untyped-def]
    view,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    world = scratch.world
    r, t = views.rotation[view], views.translation[view]
    depth = r[2, 0] * world[0] + r[2, 1] * world[LANES] + r[2, 2] * world[2 * LANES] + t[2]
    spacing_px = max(1.0, spacing_m * views.intrinsics[view, 0] / max(depth, 0.5))
    sample_outline(
        view, views, body.cone_node.size, spacing_px, step_px, scratch, outlines, samples
    )
    collect_residuals(
        view,
        views,
        contours,
        truncation_m,
        samples,
        scratch.start[view],
        scratch.order[view],
        residuals,
    )
    _accumulate(view, body.cone_node, samples, residuals, scratch.sums[view])


@compiled()
def _total(body, views, scratch):  # type: ignore[no-untyped-def]
    """Add up the views' sums, always in the same order, and fill the normal equations."""
    sums = scratch.sums[0]
    for view in range(1, views):
        for m in range(sums.shape[0]):
            for k in range(SUMS):
                sums[m, k] += scratch.sums[view, m, k]
    sum_chain(body, scratch.nodes, sums, scratch.hessian, scratch.slope)


@compiled()
def equations_serial(  # type: ignore[no-untyped-def]
    pose,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    """Residuals and per-view normal equations at a pose (p,), on the calling thread."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in range(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, truncation_m, samples, residuals,
            scratch, outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)


@compiled(parallel=True)
def equations_parallel(  # type: ignore[no-untyped-def]
    pose,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    truncation_m,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    """As `equations_serial`, a thread a view; each view sums for itself, so nothing changes."""
    cone_ends(pose, body, scratch.nodes, scratch.world)
    for view in prange(views.size.shape[0]):
        _one_view(
            view, body, views, contours, spacing_m, step_px, truncation_m, samples, residuals,
            scratch, outlines,
        )  # fmt: skip
    _total(body, views.size.shape[0], scratch)
