"""Normal equations against finite differences; the same whatever was asked before."""

import numpy as np
import pytest

from markerless_tracker.body import cone_transforms, transforms
from markerless_tracker.camera import project_camera
from markerless_tracker.fitness.arrays import body_arrays
from markerless_tracker.fitness.contour.chain_kernels import SUMS, add_wrench, sum_chain

LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)


def attached(body, pose, cone, world):
    """`world` (n, 3) points on cones (n,) as a function of the pose, rigid with their cones."""
    placed = cone_transforms(body, pose)[cone]
    local = np.einsum("nji,nj->ni", placed[:, :, :3], world - placed[:, :, 3])

    def moved(other):
        now = cone_transforms(body, other)[cone]
        return np.einsum("nij,nj->ni", now[:, :, :3], local) + now[:, :, 3]

    return moved


def numeric_jacobian(function, pose, h=1e-5):
    """(n, .., p) central differences."""
    columns = []
    for i in range(pose.size):
        step = h * np.eye(pose.size)[i]
        columns.append((function(pose + step) - function(pose - step)) / (2 * h))
    return np.stack(columns, axis=-1)


def test_equations_along_the_chain(posed, disturbed) -> None:
    """The chain's derivatives of gradient . point, for points on every cone."""
    body, rng = posed.body, np.random.default_rng(2)
    pose = disturbed(posed)
    nodes = transforms(body, pose)
    cone = np.repeat(np.arange(len(body.cone_names)), 3)
    placed = cone_transforms(body, pose)[cone]
    world = placed[:, :, 3] + rng.uniform(-0.3, 0.3, (cone.size, 3))
    gradient = rng.standard_normal((cone.size, 3))
    slow = np.einsum(
        "nip,ni->np", numeric_jacobian(attached(body, pose, cone, world), pose), gradient
    )
    arrays = body_arrays(body)
    reached = set()
    hessian, fast = np.empty((body.size, body.size)), np.empty(body.size)
    for i, c in enumerate(cone):
        sums = np.zeros((nodes.shape[0], SUMS))
        add_wrench(*world[i], *gradient[i], 2.0, 0.5, sums, body.cone_node[c])
        sum_chain(arrays, nodes, sums, np.empty((len(nodes) + 1, 6)), hessian, fast)
        np.testing.assert_allclose(fast, slow[i], atol=1e-7)
        np.testing.assert_allclose(hessian, 2.0 * np.outer(slow[i], slow[i]), atol=1e-6)
        reached.update(np.flatnonzero(fast))
    assert reached == set(range(31))


def test_normal_equations(posed, slow_residuals, disturbed) -> None:
    """JᵀWJ and JᵀWr of the slow residuals, J by finite differences through the lens."""
    pose, truncation = disturbed(posed, seed=1), 0.08
    found = posed.frame.equations(pose, truncation)
    hessian, gradient, cost = np.zeros((31, 31)), np.zeros(31), 0.0
    for v, camera in enumerate(posed.rig):
        slow = slow_residuals(posed, v, truncation)
        samples = posed.frame.samples
        points = attached(
            posed.body, pose, samples.cone[v, slow.sample], samples.world[v, slow.sample]
        )
        pixels = numeric_jacobian(lambda x, f=points, c=camera: project_camera(f(x), c), pose)
        rows = np.einsum("nip,ni->np", pixels, slow.along)
        hessian += rows.T @ (slow.weight[:, None] * rows)
        gradient += rows.T @ (slow.weight * slow.value)
        cost += slow.cost
    scale = np.sqrt(np.outer(np.diag(hessian), np.diag(hessian)))
    assert np.diag(hessian).min() > 0
    assert np.abs(found.hessian - hessian).max() < 1e-5 * np.abs(hessian).max()
    assert (np.abs(found.hessian - hessian) / scale).max() < 1e-5
    np.testing.assert_allclose(
        found.gradient, gradient, rtol=1e-5, atol=1e-5 * np.abs(gradient).max()
    )
    assert found.cost == pytest.approx(cost, rel=1e-7)
    np.testing.assert_allclose(found.hessian, found.hessian.T, rtol=1e-12)


def test_the_negative_gradient_points_downhill(posed, disturbed) -> None:
    """Along the damped step the robust cost falls: residuals and derivatives fit together."""
    pose = disturbed(posed, seed=2, size=0.02)
    found = posed.frame.equations(pose, 0.1)
    a = found.hessian + np.diag(0.1 * np.diag(found.hessian) + 1e-9)
    step = np.linalg.solve(a, -found.gradient)
    assert found.gradient @ step < 0
    costs = [posed.frame.equations(pose + t * step, 0.1).cost for t in (0.0, 0.25, 0.5, 1.0)]
    assert costs[1] < costs[0] and costs[2] < costs[1] and costs[3] < 0.5 * costs[0]


def test_earlier_calls_change_nothing(make_pose, make_scene, disturbed) -> None:
    one = make_scene("person31", 9, make_pose, lens=LENS)
    two = make_scene("person31", 9, make_pose, lens=LENS)
    pose = disturbed(one)
    first = one.frame.equations(pose, 0.1)
    one.frame.equations(one.pose, 0.02)
    for other in (one.frame.equations(pose, 0.1), two.frame.equations(pose, 0.1)):
        assert other.hessian.tobytes() == first.hessian.tobytes()
        assert other.gradient.tobytes() == first.gradient.tobytes()
        assert other.cost == first.cost
