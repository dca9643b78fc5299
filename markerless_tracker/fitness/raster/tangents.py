"""Common tangents of the two projected end ellipses of each cone.

Derivation: docs/outlines-of-cones.md.
"""

import numpy as np

from markerless_tracker.compiled import inlined, kernel
from markerless_tracker.fitness.raster.outline_arrays import (
    HIDDEN,
    LANES,
    NEAR_M,
    ONLY_END,
    TAPERED,
    TINY,
    VECTOR_LANES,
)


@kernel
def to_camera(cones, world, rotation, translation, ends):  # type: ignore[no-untyped-def]
    """Transform cone ends (18 rows) from the world into a camera's frame."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    for e in range(2):
        for i in range(3):
            r0, r1, r2 = rotation[i, 0], rotation[i, 1], rotation[i, 2]
            t = translation[i]
            for m in range(3):
                at = (9 * e + 3 * m) * LANES
                to = at + i * LANES
                for c in range(n):
                    ends[to + c] = (
                        r0 * world[at + c]
                        + r1 * world[at + LANES + c]
                        + r2 * world[at + 2 * LANES + c]
                        + t
                    )
                t = 0.0


@kernel
def find_forms(cones, ends, flat, form):  # type: ignore[no-untyped-def]
    """Fill flat (first-order images of the ends) and form from ends."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    for e in range(2):
        p, q = 9 * e * LANES, 6 * e * LANES
        for c in range(n):
            inverse = 1.0 / ends[p + 2 * LANES + c]
            x, y = ends[p + c] * inverse, ends[p + LANES + c] * inverse
            za, zb = ends[p + 5 * LANES + c], ends[p + 8 * LANES + c]
            flat[q + c], flat[q + LANES + c] = x, y
            flat[q + 2 * LANES + c] = (ends[p + 3 * LANES + c] - x * za) * inverse
            flat[q + 3 * LANES + c] = (ends[p + 4 * LANES + c] - y * za) * inverse
            flat[q + 4 * LANES + c] = (ends[p + 6 * LANES + c] - x * zb) * inverse
            flat[q + 5 * LANES + c] = (ends[p + 7 * LANES + c] - y * zb) * inverse
    for c in range(n):
        gu, gv = flat[6 * LANES + c] - flat[c], flat[7 * LANES + c] - flat[LANES + c]
        apart = gu * gu + gv * gv > 1e-18
        du, dv = (gu if apart else 1.0), (gv if apart else 0.0)
        # Extent of each end from its centre along the line of centres, times that line's length.
        pa = flat[2 * LANES + c] * du + flat[3 * LANES + c] * dv
        pb = flat[4 * LANES + c] * du + flat[5 * LANES + c] * dv
        qa = flat[8 * LANES + c] * du + flat[9 * LANES + c] * dv
        qb = flat[10 * LANES + c] * du + flat[11 * LANES + c] * dv
        wider = np.sqrt(qa * qa + qb * qb) - np.sqrt(pa * pa + pb * pb)
        gap = gu * du + gv * dv
        only = ONLY_END if gap + wider <= 0.0 else (ONLY_END + 1 if gap - wider <= 0.0 else TAPERED)
        near_0 = ends[2 * LANES + c] - abs(ends[5 * LANES + c]) - abs(ends[8 * LANES + c])
        near_1 = ends[11 * LANES + c] - abs(ends[14 * LANES + c]) - abs(ends[17 * LANES + c])
        near = near_0 if near_0 < near_1 else near_1
        form[c] = only if near > NEAR_M else HIDDEN


@kernel
def find_tangents(cones, flat, form, arcs):  # type: ignore[no-untyped-def]
    """Fill arcs: the angles at which the common tangents touch the ends, by iterated normals."""
    n = (cones + VECTOR_LANES - 1) // VECTOR_LANES * VECTOR_LANES
    for side in range(2):
        sense = 1.0 if side == 0 else -1.0
        # Side 0 begins end 1's arc and ends end 0's.
        to_0, to_1 = (2 * LANES, 4 * LANES) if side == 0 else (0, 6 * LANES)
        for c in range(n):
            gu, gv = flat[6 * LANES + c] - flat[c], flat[7 * LANES + c] - flat[LANES + c]
            au, av = flat[2 * LANES + c], flat[3 * LANES + c]
            bu, bv = flat[4 * LANES + c], flat[5 * LANES + c]
            cu, cv = flat[8 * LANES + c], flat[9 * LANES + c]
            du, dv = flat[10 * LANES + c], flat[11 * LANES + c]
            nu, nv = -gv * sense, gu * sense
            for _ in range(2):
                pa, pb = au * nu + av * nv, bu * nu + bv * nv
                qa, qb = cu * nu + cv * nv, du * nu + dv * nv
                p = 1.0 / np.sqrt(pa * pa + pb * pb + TINY)
                q = 1.0 / np.sqrt(qa * qa + qb * qb + TINY)
                tu = gu + q * (cu * qa + du * qb) - p * (au * pa + bu * pb)
                tv = gv + q * (cv * qa + dv * qb) - p * (av * pa + bv * pb)
                nu, nv = -tv * sense, tu * sense
            pa, pb = au * nu + av * nv, bu * nu + bv * nv
            qa, qb = cu * nu + cv * nv, du * nu + dv * nv
            p = 1.0 / np.sqrt(pa * pa + pb * pb + TINY)
            q = 1.0 / np.sqrt(qa * qa + qb * qb + TINY)
            arcs[to_0 + c], arcs[to_0 + LANES + c] = pa * p, pb * p
            arcs[to_1 + c], arcs[to_1 + LANES + c] = qa * q, qb * q
    for c in range(cones):
        if form[c] >= ONLY_END:
            at = 4 * (form[c] - ONLY_END) * LANES + c
            arcs[at], arcs[at + LANES] = 1.0, 0.0
            arcs[at + 2 * LANES], arcs[at + 3 * LANES] = 1.0, 0.0


@kernel
def arc_sweep(e, c, flat, form, arcs):  # type: ignore[no-untyped-def]
    """Signed angle (rad) of end e's arc of cone c."""
    if form[c] == ONLY_END + e:
        return 2.0 * np.pi
    at = 4 * e * LANES + c
    ca, sa = arcs[at], arcs[at + LANES]
    cb, sb = arcs[at + 2 * LANES], arcs[at + 3 * LANES]
    sweep = np.arctan2(ca * sb - sa * cb, ca * cb + sa * sb)
    if clockwise(6 * e * LANES + c, flat):
        return sweep - 2.0 * np.pi if sweep > 0.0 else sweep
    return sweep + 2.0 * np.pi if sweep < 0.0 else sweep


@inlined
def clockwise(at, flat):  # type: ignore[no-untyped-def]
    """Whether the arc of the end whose rows in flat begin at `at` runs towards smaller angles."""
    return flat[at + 2 * LANES] * flat[at + 5 * LANES] > flat[at + 3 * LANES] * flat[at + 4 * LANES]
