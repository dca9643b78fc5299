"""A chair: boxes with subdivided sides, so that shadows fall on parts of them."""

import numpy as np

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray

_STEP_M = 0.05


def chair(
    seat_m: float, place_m: tuple[float, float], heading: float
) -> tuple[FloatArray, IntArray]:
    """Vertices (k, 3) in m, world frame, and triangles (m, 3) of a chair.

    Args:
        seat_m: height of its seat.
        place_m: position of the hips of a person that sits on it.
        heading: direction in which that person faces, rad.
    """
    boxes = [((-0.24, -0.21, seat_m - 0.035), (0.18, 0.21, seat_m))]
    boxes += [
        ((x, y, 0.0), (x + 0.035, y + 0.035, seat_m - 0.035))
        for x in (-0.235, 0.14)
        for y in (-0.205, 0.17)
    ]
    boxes += [((-0.27, -0.20, seat_m + 0.10), (-0.245, 0.20, seat_m + 0.42))]
    boxes += [
        ((-0.27, y, seat_m - 0.035), (-0.245, y + 0.03, seat_m + 0.12)) for y in (-0.20, 0.17)
    ]
    vertices, triangles, count = [], [], 0
    for low, high in boxes:
        for axis in range(3):
            for end in (low, high):
                v, t = _side(np.array(low), np.array(high), axis, end[axis], end is high)
                vertices.append(v)
                triangles.append(t + count)
                count += len(v)
    cos, sin = np.cos(heading), np.sin(heading)
    points = np.concatenate(vertices) @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0, 0, 1.0]])
    points[:, :2] += place_m
    return points, np.ascontiguousarray(np.concatenate(triangles))


def _side(
    low: FloatArray, high: FloatArray, axis: int, level: float, outward: bool
) -> tuple[FloatArray, IntArray]:
    """One side of a box as a grid; its corners wind outward."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    counts = [max(2, int(np.ceil((high[k] - low[k]) / _STEP_M)) + 1) for k in (a, b)]
    u, v = np.meshgrid(
        np.linspace(low[a], high[a], counts[0]), np.linspace(low[b], high[b], counts[1]),
        indexing="ij",
    )  # fmt: skip
    points = np.empty((u.size, 3))
    points[:, axis], points[:, a], points[:, b] = level, u.ravel(), v.ravel()
    corner = np.arange(u.size).reshape(u.shape)
    p, q, r, s = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([p, q, r], -1).reshape(-1, 3), np.stack([p, r, s], -1).reshape(-1, 3)]
    )
    return points, triangles if outward else triangles[:, ::-1]
