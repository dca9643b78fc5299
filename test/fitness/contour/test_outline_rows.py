"""Residuals one by one, and how they change with pose and sections: against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import cone_transforms, load_body
from markerless_tracker.fitness.contour.outline_rows import (
    length_jacobian,
    outline_rows,
    pose_jacobian,
    surface,
)
from markerless_tracker.fitness.shape import Sections
from markerless_tracker.synthesis import ring_rig

BODY = load_body("person31", 1.75)
STOUT = replace(BODY, cone_shape=BODY.cone_shape * [1.15, 1.1, 1.0, 1.0])
H = 1e-6


def bent():
    pose = BODY.neutral.copy()
    pose[BODY.joints] += np.random.default_rng(4).uniform(-0.2, 0.2, BODY.joints.size)
    for name, value in (("pelvis_rz", 0.7), ("pelvis_rx", 0.1), ("pelvis_tz", 0.95),
                        ("l_knee", -0.5), ("r_elbow", -0.9)):  # fmt: skip
        pose[BODY.index(name)] = value
    return pose


POSE = bent()


@pytest.fixture(scope="module")
def frame(contours_of):
    frame = contours_of(STOUT, POSE, ring_rig(4, (656, 490)), BODY)
    frame.collect(POSE, 0.1)
    return frame


def slow_surface(body, pose, cone, place):
    """World points of places on cones: cos, sin on both ends, fraction of end 1."""
    placed = cone_transforms(body, pose)[cone]
    t = place[:, 4:]
    ends = []
    for e in range(2):
        radius, offset = body.cone_shape[cone, e, :2], body.cone_shape[cone, e, 2:]
        flat = offset + radius * place[:, 2 * e : 2 * e + 2]
        ends.append(np.column_stack([flat, e * body.cone_length[cone]]))
    local = (1.0 - t) * ends[0] + t * ends[1]
    return np.einsum("nij,nj->ni", placed[:, :, :3], local) + placed[:, :, 3]


def test_rows_are_the_residuals_of_all_views_in_order(frame) -> None:
    rows = outline_rows(frame)
    counts = frame.residuals.count
    assert rows.value.size == counts.sum() and counts.min() > 300
    begin = 0
    for view, n in enumerate(counts):
        here = slice(begin, begin := begin + int(n))
        sample = frame.residuals.sample[view, :n]
        np.testing.assert_array_equal(rows.value[here], frame.residuals.value[view, :n])
        np.testing.assert_array_equal(rows.weight[here], frame.residuals.weight[view, :n])
        np.testing.assert_allclose(
            surface(BODY, POSE, rows)[here], frame.samples.world[view, sample], atol=1e-12
        )


def test_the_surface_is_the_cones(frame) -> None:
    rows = outline_rows(frame)
    np.testing.assert_allclose(
        surface(STOUT, POSE, rows), slow_surface(STOUT, POSE, rows.cone, rows.place), atol=1e-12
    )


def test_jacobian_by_the_pose(frame) -> None:
    rows = outline_rows(frame)
    jacobian = pose_jacobian(BODY, POSE, rows)
    for k in range(BODY.size):
        step = H * np.eye(BODY.size)[k]
        there, back = (
            slow_surface(BODY, POSE + s, rows.cone, rows.place) for s in (step, -step)
        )  # fmt: skip
        slow = ((there - back) / (2 * H) * rows.gradient).sum(axis=1)
        np.testing.assert_allclose(jacobian[:, k], slow, atol=1e-7)
    assert (np.abs(jacobian).max(axis=0) > 0.01).all()


def test_normal_equations_are_the_refinements(frame) -> None:
    """The kernels that sum along the chain give the same without rows."""
    sums = frame.equations(POSE, 0.1)
    rows = outline_rows(frame)
    jacobian = pose_jacobian(BODY, POSE, rows)
    scale = np.abs(sums.hessian).max()
    np.testing.assert_allclose(
        jacobian.T @ (rows.weight[:, None] * jacobian), sums.hessian, atol=1e-9 * scale
    )
    np.testing.assert_allclose(
        jacobian.T @ (rows.weight * rows.value),
        sums.gradient,
        atol=1e-9 * np.abs(sums.gradient).max(),
    )


def test_jacobian_by_the_lengths(frame) -> None:
    rows = outline_rows(frame)
    step = 1e-4
    longer = [
        replace(BODY, node_fixed=BODY.node_fixed * (1.0 + step)),
        replace(BODY, cone_length=BODY.cone_length * (1.0 + step)),
    ]
    points = surface(BODY, POSE, rows)
    jacobian = length_jacobian(longer, POSE, rows, points, step)
    for k, body in enumerate(longer):
        moved = slow_surface(body, POSE, rows.cone, rows.place) - points
        np.testing.assert_allclose(
            jacobian[:, k], (moved * rows.gradient).sum(axis=1) / step, atol=1e-8
        )
    assert (np.abs(jacobian).max(axis=0) > 0.01).all()


@pytest.mark.parametrize("hands", [False, True])
def test_jacobian_by_the_sections(frame, hands) -> None:
    rows, sections = outline_rows(frame), Sections(BODY, hands=hands)
    assert sections.size < BODY.cone_shape.size
    start = sections.of(BODY)
    np.testing.assert_array_equal(sections.put(BODY, start).cone_shape, BODY.cone_shape)
    jacobian = sections.jacobian(BODY, POSE, rows)
    for k in range(sections.size):
        step = H * np.eye(sections.size)[k]
        there, back = (
            slow_surface(sections.put(BODY, start + s), POSE, rows.cone, rows.place)
            for s in (step, -step)
        )
        slow = ((there - back) / (2 * H) * rows.gradient).sum(axis=1)
        np.testing.assert_allclose(jacobian[:, k], slow, atol=1e-7)
    # Nearly every section is visible in some camera.
    assert (np.abs(jacobian).max(axis=0) > 0.05).mean() > 0.9
