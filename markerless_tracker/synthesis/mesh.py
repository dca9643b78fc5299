"""The surface of a body's cones as triangles."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

AROUND = 48
"""Corners of a section; an inscribed 48-gon lies within 0.2 % of the radius."""
ALONG = 4
"""Pieces along the axis, so that a lens can bend the sides."""


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """Triangles of all cones, each closed with two caps, in the cones' base frames.

    The side joins points of both ends that have the same normal: the convex hull of the ends.

    Attributes:
        vertices: (k, 3) in m, in the base frame of the vertex's cone.
        normals: (k, 3) unit, outward.
        cone: (k,) cone of each vertex.
        triangles: (m, 3) vertex indices.
    """

    vertices: FloatArray
    normals: FloatArray
    cone: IntArray
    triangles: IntArray

    def posed(self, body: BodyModel, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Vertices (k, 3) in m and normals (k, 3), world frame, at a pose (p,)."""
        T = cone_transforms(body, pose)[self.cone]
        rotation = T[:, :, :3]
        return (
            np.einsum("nij,nj->ni", rotation, self.vertices) + T[:, :, 3],
            np.einsum("nij,nj->ni", rotation, self.normals),
        )


def body_mesh(body: BodyModel) -> BodyMesh:
    """The mesh of a body."""
    vertices, normals, cones, triangles, first = [], [], [], [], 0
    for i, (length, shape) in enumerate(zip(body.cone_length, body.cone_shape, strict=True)):
        v, n, t = _cone(float(length), shape)
        vertices.append(v)
        normals.append(n)
        cones.append(np.full(len(v), i))
        triangles.append(t + first)
        first += len(v)
    return BodyMesh(
        locked(np.concatenate(vertices), float),
        locked(np.concatenate(normals), float),
        locked(np.concatenate(cones), np.int64),
        locked(np.concatenate(triangles), np.int64),
    )


def _cone(length: float, shape: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    # Normals of evenly spaced points on the mean section: even ones leave flat sides to few points.
    direction = np.column_stack([np.cos(angle), np.sin(angle)]) / shape[:, :2].mean(axis=0)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    # The point of an ellipse with radii r whose normal is n: r² n / |r n|.
    ends = [
        e[2:] + e[:2] ** 2 * direction / np.linalg.norm(e[:2] * direction, axis=1)[:, None]
        for e in shape
    ]
    rings = [
        np.column_stack([(1.0 - t) * ends[0] + t * ends[1], np.full(AROUND, t * length)])
        for t in np.linspace(0.0, 1.0, ALONG + 1)
    ]
    # The side leans by the change of the support function along the axis.
    change = np.einsum("ni,ni->n", ends[1] - ends[0], direction)
    side = np.column_stack([direction, -change / length])
    side /= np.linalg.norm(side, axis=1)[:, None]
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate([*rings, rings[0], rings[-1]])
    normals = np.concatenate(
        [side] * (ALONG + 1) + [np.tile(down, (AROUND, 1)), np.tile(up, (AROUND, 1))]
    )
    here, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    triangles = []
    for ring in range(ALONG):
        a, b = ring * AROUND + here, ring * AROUND + after
        triangles += [
            np.column_stack([a, b, b + AROUND]),
            np.column_stack([a, b + AROUND, a + AROUND]),
        ]
    for cap in (ALONG + 1, ALONG + 2):
        fan = cap * AROUND + np.arange(AROUND)
        triangles.append(np.column_stack([np.full(AROUND - 2, fan[0]), fan[1:-1], fan[2:]]))
    return vertices, normals, np.concatenate(triangles).astype(np.int64)
