"""Residuals between the model's outline and the silhouettes' edges, one by one and by hand."""

import numpy as np
import pytest

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import project_camera
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation


def standing(body: BodyModel) -> FloatArray:
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    return pose


@pytest.mark.parametrize("truncation", [0.03, 0.1])
def test_residuals_weights_and_cost(posed, truncation, slow_residuals, disturbed) -> None:
    posed.frame.collect(disturbed(posed), truncation)
    kept = outliers = 0
    for v in range(len(posed.rig)):
        slow = slow_residuals(posed, v, truncation)
        fast = posed.frame.residuals
        n = fast.count[v]
        assert n == len(slow.value) > 30
        np.testing.assert_array_equal(fast.sample[v, :n], slow.sample)
        np.testing.assert_allclose(fast.value[v, :n], slow.value, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(fast.weight[v, :n], slow.weight, rtol=1e-6, atol=1e-12)
        assert fast.cost[v] == pytest.approx(slow.cost, rel=1e-7)
        both = posed.frame.samples.count[v] + len(posed.edges(posed.rig.cameras[v]).points)
        kept, outliers = kept + n, outliers + both - n
    # The truncation leaves some out, and not all.
    assert kept > 300 and outliers > 0.01 * kept


def test_gradients_by_the_world_point(posed, slow_residuals, disturbed) -> None:
    """Moving a sample's world point by a little moves its pixel, hence its residual."""
    posed.frame.collect(disturbed(posed), 0.1)
    h = 1e-5
    for v, camera in enumerate(posed.rig):
        slow = slow_residuals(posed, v, 0.1)
        fast = posed.frame.residuals.gradient[v, :, : len(slow.value)].T
        world = posed.frame.samples.world[v, slow.sample]
        numeric = np.empty_like(fast)
        for axis in range(3):
            step = h * np.eye(3)[axis]
            moved = project_camera(world + step, camera) - project_camera(world - step, camera)
            numeric[:, axis] = (slow.along * moved).sum(axis=1) / (2 * h)
        scale = np.linalg.norm(numeric, axis=1, keepdims=True)
        assert (scale > 0.3).all()
        assert (np.abs(fast - numeric) / scale).max() < 1e-6


def test_one_residual_by_hand(make_scene) -> None:
    """A body 20 mm beside its silhouette: sideways residuals are 20 mm, weighted by Tukey."""
    made = make_scene("balan31", 0, lambda body, *_, **__: standing(body), cameras=1)
    camera, truncation = made.rig.cameras[0], 0.05
    pose = made.pose.copy()
    pose[[made.body.index(f"pelvis_t{a}") for a in "xyz"]] += 0.020 * camera.T_cam_world[0, :3]
    made.frame.collect(pose, truncation)
    residuals, samples = made.frame.residuals, made.frame.samples
    s = residuals.sample[0, : residuals.count[0]]
    value, weight = residuals.value[0, : s.size], residuals.weight[0, : s.size]
    leg = np.isin(samples.cone[0, s], [made.body.cone_names.index(c) for c in ("l_calf", "r_calf")])
    side = samples.normal[0, s, 0]
    for sense in (1.0, -1.0):
        found = value[leg & (sense * side > 0.99)]
        assert found.size > 15
        assert np.median(found) == pytest.approx(sense * 0.020, abs=0.0035)
        # In both directions: the body's points to the edge, the edge's points to the body.
        assert found.std() < 0.005
    first = int(np.flatnonzero(leg & (np.abs(side) > 0.99))[0])
    # 1 - (20 mm / 50 mm)² = 0.84, squared 0.7056.
    share = weight[first] / samples.length[0, s[first]]
    assert share == pytest.approx((1.0 - (value[first] / 0.05) ** 2) ** 2, rel=1e-12)
    assert share == pytest.approx(0.7056, abs=0.12)


def test_no_evidence_costs_the_most_and_has_no_gradient(make_pose, make_scene) -> None:
    made = make_scene("person31", 8, make_pose)
    blank = {
        name: Observation.from_mask(name, 0, np.zeros_like(o.mask), o.edges)
        for name, o in made.observations.items()
    }
    frame = ContourFrame(
        made.body, {c.name: c for c in made.rig}, blank, Fitness(made.body, made.rig.cameras)
        .lay_out(blank), pixels_per_m=dict.fromkeys(made.rig.names, 150.0),
    )  # fmt: skip
    found = frame.equations(made.pose, 0.1)
    assert not found.hessian.any() and not found.gradient.any()
    total = sum(frame.samples.length[v, : frame.samples.count[v]].sum() for v in range(4))
    assert found.cost == pytest.approx(total * 0.1**2 / 6.0)
