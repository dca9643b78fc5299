"""The mesh of the cones lies on the cones."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from markerless_tracker.body import cone_transforms, load_body
from markerless_tracker.synthesis.mesh import AROUND, body_mesh

BODY = load_body("balan31")


def one_cone(length, shape):
    """Vertices, normals and triangles of the first cone of a body that has this one."""
    lengths, shapes = BODY.cone_length.copy(), BODY.cone_shape.copy()
    lengths[0], shapes[0] = length, shape
    mesh = body_mesh(dataclasses.replace(BODY, cone_length=lengths, cone_shape=shapes))
    mine = mesh.cone == 0
    inside = (mesh.triangles < mine.sum()).all(axis=1)
    return mesh.vertices[mine], mesh.normals[mine], mesh.triangles[inside]


def volume(vertices, triangles):
    """Volume of a closed mesh by the divergence theorem, corners in either order."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    middle = vertices.mean(axis=0)
    return np.abs(np.einsum("ni,ni->n", a - middle, np.cross(b - middle, c - middle))).sum() / 6


def test_a_cylinder() -> None:
    vertices, normals, triangles = one_cone(0.5, [[0.1, 0.1, 0, 0]] * 2)
    assert volume(vertices, triangles) == pytest.approx(np.pi * 0.01 * 0.5, rel=0.005)
    side = normals[:, 2] == 0.0
    np.testing.assert_allclose(normals[side, :2] * 0.1, vertices[side, :2], atol=1e-12)
    np.testing.assert_array_equal(np.unique(normals[~side, 2]), [-1.0, 1.0])


end = st.tuples(
    st.floats(0.05, 0.2), st.floats(0.05, 0.2), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)
)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.05, 1.0), end, end)
def test_the_mesh_is_the_convex_hull_of_the_ends(length, start, stop) -> None:
    vertices, normals, triangles = one_cone(length, [start, stop])
    angle = np.linspace(0, 2 * np.pi, 181)[:-1]
    ends = np.concatenate(
        [
            np.column_stack([ox + rx * np.cos(angle), oy + ry * np.sin(angle), np.full(180, z)])
            for (rx, ry, ox, oy), z in ((start, 0.0), (stop, length))
        ]
    )
    hull = ConvexHull(ends)
    # No vertex sticks out, and little volume is lost to the corners.
    outside = hull.equations[:, :3] @ vertices.T + hull.equations[:, 3:]
    assert outside.max() < 2e-4
    assert volume(vertices, triangles) == pytest.approx(hull.volume, rel=0.02)
    # The hull lies behind the plane through each vertex with its normal.
    for vertex, normal in zip(vertices[::17], normals[::17], strict=True):
        assert ((ends - vertex) @ normal).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_posed_vertices_hang_from_their_cones() -> None:
    pose = np.linspace(-1, 1, BODY.size)
    mesh = body_mesh(BODY)
    vertices, normals = mesh.posed(BODY, pose)
    for cone, T in enumerate(cone_transforms(BODY, pose)):
        mine = mesh.cone == cone
        back = (vertices[mine] - T[:, 3]) @ T[:, :3]
        np.testing.assert_allclose(back, mesh.vertices[mine], atol=1e-12)
        np.testing.assert_allclose(normals[mine] @ T[:, :3], mesh.normals[mine], atol=1e-12)
        start = back[:AROUND].mean(axis=0)
        np.testing.assert_allclose(start, 0.0, atol=1e-12)
