"""Model edges: samples of the edge map along the outlines of cones."""

from typing import NamedTuple

import numpy as np

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.bits import is_set
from markerless_tracker.fitness.raster.outline_arrays import ARC_POINTS, LANES, TAPERED

SIDES, VISIBLE, OUTLINE = 0, 1, 2
"""Sampled model edges: all sides; sides that no nearer cone hides; the outline of the body."""
_LONGEST_PX = 1e6
"""Longer sides are not sampled."""


class EdgeRule(NamedTuple):
    """How edges are sampled: rule, spacing and outward step in px, whether costs are squared."""

    rule: int
    spacing_px: float
    step_px: float
    squared: bool


@kernel
def sample_side(  # type: ignore[no-untyped-def]
    pu, pv, qu, qv, outward, bits, static, start, edges, edge_start, width, height, rule,
    listed, listed_count,
):  # fmt: skip
    """Add up the edge map along the segment (pu, pv) to (qu, qv).

    Args:
        outward: +1 or -1, the side of the segment away from its cone.
        bits: pixels that hide a sample: of nearer cones (VISIBLE) or of the moving parts (OUTLINE).
        static: pixels of the static parts, flat from `start` on, that hide it as well (OUTLINE);
            may be empty.
        edges: uint8 edge map, flat from `edge_start` on.
        listed: (s, 2): samples that other parts may hide (OUTLINE) are not added but listed here,
            from row `listed_count` on: word * 64 + bit that hides the sample, its contribution.
            With no rows all samples are added.

    Returns:
        Contributions to EDGE_SUM and EDGE_COUNT; the number of listed samples.
    """
    total, number = 0, 0
    du, dv = qu - pu, qv - pv
    length = np.sqrt(du * du + dv * dv)
    if not (length > 0.0 and length < _LONGEST_PX):
        return total, number, listed_count
    samples = np.int64(max(4.0, length / rule.spacing_px))
    step = outward * rule.step_px / length
    out_u, out_v = -step * dv + 0.5, step * du + 0.5
    share = 1.0 / samples
    du, dv = du * share, dv * share
    pu, pv = pu + 0.5 * du, pv + 0.5 * dv
    u_end, v_end = width - 0.5, height - 0.5
    beside, squared, which = static.size > 0, rule.squared, rule.rule
    listing = listed.shape[0] > 0
    qu, qv = pu + (samples - 1) * du, pv + (samples - 1) * dv
    border = abs(rule.step_px) + 1.0
    if (
        not listing
        and which != SIDES
        and min(pu, qu) >= border
        and min(pv, qv) >= border
        and max(pu, qu) <= width - 1.0 - border
        and max(pv, qv) <= height - 1.0 - border
    ):
        # The same as below without branches, for a side away from the frame's border.
        if which == VISIBLE:
            out_u, out_v = 0.5, 0.5
        for i in range(samples):
            u, v = pu + i * du, pv + i * dv
            far_u, far_v = np.uint64(np.int64(u + out_u)), np.uint64(np.int64(v + out_v))
            there = (far_u >> np.uint64(6)) * np.uint64(height) + far_v
            hiding = bits[there]
            if beside:
                hiding |= static[np.uint64(start) + there]
            free = int(~(hiding >> (far_u & np.uint64(63))) & np.uint64(1))
            pixel = np.int64(v + 0.5) * width + np.int64(u + 0.5)
            total += free * _contribution(edges[np.uint64(edge_start + pixel)], squared)
            number += free
        return total, number, listed_count
    for i in range(samples):
        u, v = pu + i * du, pv + i * dv
        if not (u >= -0.5 and v >= -0.5 and u < u_end and v < v_end):
            continue
        column, row = np.int64(u + 0.5), np.int64(v + 0.5)
        if which == VISIBLE:
            if is_set(bits, height, column, row):
                continue
        elif which == OUTLINE:
            x, y = np.int64(np.floor(u + out_u)), np.int64(np.floor(v + out_v))
            if x >= 0 and x < width and y >= 0 and y < height:
                at = np.uint64((x >> 6) * height + y)
                word = bits[at]
                if beside:
                    word |= static[np.uint64(start) + at]
                if (word >> np.uint64(x & 63)) & np.uint64(1) != np.uint64(0):
                    continue
                if listing:
                    listed[listed_count, 0] = np.int64(at) * 64 + (x & 63)
                    value = _contribution(
                        edges[np.uint64(edge_start + row * width + column)], squared
                    )
                    listed[listed_count, 1] = value
                    listed_count += 1
                    continue
        total += _contribution(edges[np.uint64(edge_start + row * width + column)], squared)
        number += 1
    return total, number, listed_count


@inlined
def _contribution(strength, squared):  # type: ignore[no-untyped-def]
    missing = 255 - np.int64(strength)
    return missing * missing if squared else 255 - missing


@kernel
def sample_cone(  # type: ignore[no-untyped-def]
    c, count, wanted, out, bits, static, start, edges, edge_start, width, height, rule,
    listed, listed_count,
):  # fmt: skip
    """Sample the sides of one cone, and the edge of its far end, as wanted (c, 2) says.

    Arguments and returned values as of `sample_side`.
    """
    total, number = 0, 0
    if out.form[c] != TAPERED:
        return total, number, listed_count
    u, v = out.u, out.v
    far, near, last = c, (ARC_POINTS - 1) * LANES + c, (count // 2) * LANES + c
    end = last + (ARC_POINTS - 1) * LANES
    for side in range(3):
        if side == 0:
            a, b, outward, asked = end, far, 1.0, wanted[c, 0]
        elif side == 1:
            a, b, outward, asked = last, near, -1.0, wanted[c, 0]
        else:
            a, b, outward, asked = far, near, 1.0, wanted[c, 1]
        if asked:
            more, found, listed_count = sample_side(
                u[a], v[a], u[b], v[b], outward, bits, static, start, edges, edge_start, width,
                height, rule, listed, listed_count,
            )  # fmt: skip
            total, number = total + more, number + found
    return total, number, listed_count


@kernel
def recount_static(view, static, bits):  # type: ignore[no-untyped-def]
    """EDGE_SUM and EDGE_COUNT of a view's static samples that no moving part hides."""
    total, number = 0, 0
    for s in range(static.sample_start[view], static.sample_start[view + 1]):
        at = np.uint64(static.samples[s, 0])
        if (bits[at >> np.uint64(6)] >> (at & np.uint64(63))) & np.uint64(1) == np.uint64(0):
            total += static.samples[s, 1]
            number += 1
    return total, number
