"""Residuals and normal equations of all views at a pose, and the refinement of a pose with them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import compiled, inlined, kernel
from markerless_tracker.fitness.contour.chain_kernels import SUMS, add_wrench, sum_chain
from markerless_tracker.fitness.contour.floor import add_floor
from markerless_tracker.fitness.contour.nearest import Bands, make_bands
from markerless_tracker.fitness.contour.outline_samples import sample_outline
from markerless_tracker.fitness.contour.residuals import collect_residuals
from markerless_tracker.fitness.raster.kernels import cone_ends
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim.gauss_newton import (
    DAMPING,
    SOLVED,
    StepScratch,
    make_step_scratch,
    solve_step,
)


class ContourScratch(NamedTuple):
    """Working memory, per view: m nodes (once), c cones, frames of h rows of w words."""

    nodes: FloatArray  # (m, 3, 4)
    world: FloatArray  # (18 * LANES,), rows as of Outlines.ends
    bits: NDArray[np.uint64]  # (v, w * h), zero between calls
    used: NDArray[np.int64]  # (v, w, 2)
    bands: Bands
    sums: FloatArray  # (v, m, SUMS)
    twists: FloatArray  # (m + 1, 6)
    hessian: FloatArray  # (p, p)
    gradient: FloatArray  # (p,)
    step: StepScratch


def make_contour_scratch(
    views: int, nodes: int, parameters: int, height: int, words: int
) -> ContourScratch:
    """Allocate working memory."""
    return ContourScratch(
        np.empty((nodes, 3, 4)),
        np.ones(18 * LANES),
        np.zeros((views, words * height), dtype=np.uint64),
        np.empty((views, words, 2), dtype=np.int64),
        make_bands(views, height),
        np.empty((views, nodes, SUMS)),
        np.empty((nodes + 1, 6)),
        np.empty((parameters, parameters)),
        np.empty(parameters),
        make_step_scratch(parameters),
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
            world[s, 0], world[s, 1], world[s, 2], gradient[0, n], gradient[1, n], gradient[2, n],
            weight[n], value[n], sums, cone_node[cone[s]],
        )  # fmt: skip


@inlined
def _depth(view, views, world):  # type: ignore[no-untyped-def]
    """Depth of the first cone's end in a view, m."""
    r = views.rotation[view]
    depth = r[2, 0] * world[0] + r[2, 1] * world[LANES] + r[2, 2] * world[2 * LANES]
    return depth + views.translation[view, 2]


@compiled()
def descend(  # type: ignore[no-untyped-def]
    pose,
    steps,
    truncations,
    precision,
    prior_mean,
    prior_precision,
    bounds,
    floor_precision,
    standing,
    body,
    views,
    contours,
    spacing_m,
    step_px,
    samples,
    residuals,
    scratch,
    outlines,
):  # fmt: skip
    """Damped Gauss-Newton steps of a pose on one frame's contours, one per truncation.

    The only compiled entry: with 0 steps it fills the residuals and equations at the pose; with as
    many steps as truncations it is `optim.refine`.

    Args:
        pose: (p,), changed in place.
        steps: number of steps; at further truncations the equations are filled without a step.
        truncations: (n,) m, of each step: residuals beyond it are outliers.
        precision: factor of the data's equations.
        prior_mean, prior_precision: (k, p) of Gaussian priors.
        bounds: (2, p) of the pose.
        floor_precision: 1 / m², of the prior that no part lies below the floor; 0 = none.
        standing: whether the floor's prior uses the height of the ankles.
        body, views, contours: `BodyArrays`, `ViewArrays`, `ContourViews`.
        spacing_m: distance of neighbouring outline points, at the body.
        step_px: distance outward of an outline point at which no cone may cover the pixel.
        samples, residuals: `Samples`, `Residuals`; filled with those of the last truncation.
        scratch, outlines: working memory.
    """
    hessian, gradient, count = scratch.hessian, scratch.gradient, views.size.shape[0]
    for i in range(truncations.size):
        cone_ends(pose, body, scratch.nodes, scratch.world)
        for view in range(count):
            focal = views.intrinsics[view, 0]
            spacing_px = max(1.0, spacing_m * focal / max(_depth(view, views, scratch.world), 0.5))
            sample_outline(
                view, views, body.cone_node.size, spacing_px, step_px, scratch, outlines, samples
            )
            collect_residuals(
                view, views, contours, truncations[i], samples, scratch.bands, residuals
            )
            _accumulate(view, body.cone_node, samples, residuals, scratch.sums[view])
        # The views' sums are added in their order.
        for view in range(1, count):
            for m in range(scratch.sums.shape[1]):
                for k in range(SUMS):
                    scratch.sums[0, m, k] += scratch.sums[view, m, k]
        if floor_precision > 0.0 and i < steps:
            add_floor(body, scratch.world, floor_precision / precision, standing, scratch.sums[0])
        sum_chain(body, scratch.nodes, scratch.sums[0], scratch.twists, hessian, gradient)
        if i >= steps:
            continue
        for a in range(pose.size):
            gradient[a] *= precision
            for b in range(pose.size):
                hessian[a, b] *= precision
            for k in range(prior_mean.shape[0]):
                hessian[a, a] += prior_precision[k, a]
                gradient[a] += prior_precision[k, a] * (pose[a] - prior_mean[k, a])
        if solve_step(hessian, gradient, pose, bounds, DAMPING, scratch.step) != SOLVED:
            return
        for a in range(pose.size):
            # Rounding may put the sum beyond a bound.
            pose[a] = min(max(pose[a] + scratch.step.step[a], bounds[0, a]), bounds[1, a])
