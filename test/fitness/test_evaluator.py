"""Fitness and evaluators: defined values in odd cases, terms, weights, threads, batches."""

import os
from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import ImageError
from markerless_tracker.fitness import EDGE_RULES, Fitness
from markerless_tracker.geometry import rotation_from_rodrigues, transform
from markerless_tracker.records import Observation

FAR_M = 1000.0


def test_the_pose_that_made_the_silhouettes_costs_least(
    twin, make_observation, make_pose, body, rig, pose, make_comparison
):
    seen = {c.name: make_observation(c, twin(body, c, pose).silhouette()) for c in rig}
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(seen)
    assert min(t.silhouette for t in fitness.terms(views, pose).values()) > 0.98
    evaluate = fitness.prepare(views, make_comparison(body, pose, edge_weight=0.0))
    rng = np.random.default_rng(0)
    others = pose + 3.0 * body.sigma * rng.standard_normal((20, body.size))
    costs = evaluate(np.concatenate([pose[None], others]))
    assert costs[0] < costs[1:].min()


def test_only_active_parameters_leave_the_centre(body, rig, pose, observations, make_comparison):
    active = np.array([3, 5, 9])
    fitness = Fitness(body, rig.cameras)
    evaluate = fitness.prepare(
        fitness.lay_out(observations), make_comparison(body, pose, active=active)
    )
    points = np.array([[0.1, 0.9, -0.2], [-0.1, 1.0, 0.0]])
    poses = evaluate.poses(points)
    np.testing.assert_array_equal(poses[:, active], points)
    still = np.setdiff1d(np.arange(body.size), active)
    np.testing.assert_array_equal(poses[:, still], np.tile(pose[still], (2, 1)))
    whole = fitness.prepare(fitness.lay_out(observations), make_comparison(body, pose))
    np.testing.assert_array_equal(evaluate(points), whole(poses))


def test_a_body_behind_a_camera_is_not_in_its_view(make_observation, body, pose):
    matrix = np.array([[200.0, 0.0, 50.0], [0.0, 200.0, 50.0], [0.0, 0.0, 1.0]])
    # Looks along +x from the origin; the body stands behind it, then in front.
    rotation = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    camera = CameraModel("a", (100, 100), matrix, np.zeros(5), transform(rotation, [0, 0.95, 0]))
    fitness = Fitness(body, [camera])
    views = fitness.lay_out({"a": make_observation(camera, np.ones((100, 100), bool))})
    overlaps = []
    for x in (-3.0, 3.0):
        pose[body.index("pelvis_tx")] = x
        terms = fitness.terms(views, pose)["a"]
        assert np.isfinite([terms.silhouette, terms.edges, terms.overlap]).all()
        overlaps.append(terms.overlap)
    assert overlaps[0] == 0.0 < overlaps[1]


def test_points_that_are_not_finite_cost_nan_and_spoil_no_other(
    body, rig, pose, observations, make_comparison
):
    fitness = Fitness(body, rig.cameras)
    evaluate = fitness.prepare(fitness.lay_out(observations), make_comparison(body, pose))
    good = evaluate(np.tile(pose, (2, 1)))
    batch = np.tile(pose, (5, 1))
    batch[1, 0], batch[2, 7], batch[3, 30] = np.nan, np.inf, -np.inf
    costs = evaluate(batch)
    np.testing.assert_array_equal(np.isnan(costs), [False, True, True, True, False])
    np.testing.assert_array_equal(costs[[0, 4]], good)


@pytest.mark.parametrize("lens", [False, True], ids=["pinhole", "lens"])
def test_finite_poses_cost_something_finite_however_far(
    make_observation, smooth_edges, body, rig, lens_rig, pose, lens, make_comparison
):
    shown = lens_rig if lens else rig
    seen = {
        c.name: make_observation(c, np.ones(c.size_px[::-1], bool), smooth_edges(c, 0))
        for c in shown
    }
    fitness = Fitness(body, shown.cameras)
    evaluate = fitness.prepare(fitness.lay_out(seen), make_comparison(body, pose))
    rng = np.random.default_rng(1)
    poses = np.concatenate(
        [
            pose + size * rng.standard_normal((12, body.size))
            for size in (0.5, 5.0, 100.0, 1e6, 1e12, 1e100, 1e300)
        ]
    )
    costs = evaluate(poses)
    assert np.isfinite(costs).all()
    assert (costs >= 0.0).all()
    assert (costs <= 2.0).all()
    # An extreme pose must not influence the next one.
    np.testing.assert_array_equal(evaluate(poses[::-1]), costs[::-1])


@pytest.mark.parametrize("rule", EDGE_RULES)
def test_the_same_costs_with_any_number_of_threads(body, lens_rig, pose, make_observation, rule,
                                                   smooth_edges, twin,
                                                   make_comparison):  # fmt: skip
    seen = {
        c.name: make_observation(c, twin(body, c, pose).silhouette(), smooth_edges(c, 5))
        for c in lens_rig
    }
    rng = np.random.default_rng(2)
    poses = pose + 4.0 * body.sigma * rng.standard_normal((23, body.size))
    poses[4, 4] = np.nan
    costs = {}
    for threads in (1, 2, 7):
        fitness = Fitness(body, lens_rig.cameras, threads=threads, edge_rule=rule)
        assert fitness.threads <= (os.cpu_count() or 1)
        evaluate = fitness.prepare(fitness.lay_out(seen), make_comparison(body, pose))
        costs[threads] = evaluate(poses).tobytes()
        singles = np.concatenate([evaluate(one[None]) for one in poses])
        assert singles.tobytes() == costs[threads]
    assert costs[1] == costs[2] == costs[7]


def test_a_region_costs_the_same_as_the_full_frame(body, rig, pose, observations, make_comparison):
    regions = {}
    for name, full in observations.items():
        rows, columns = np.nonzero(full.mask)
        v, u = rows.min(), columns.min()
        window = np.s_[v : rows.max() + 1, u : columns.max() + 1]
        edges = np.zeros_like(full.edges)
        edges[window] = full.edges[window]
        observations[name] = Observation.from_mask(name, 0, full.mask, edges)
        regions[name] = Observation.from_mask(
            name, 0, full.mask[window], edges[window], size_px=full.size_px,
            offset_px=(int(u), int(v)),
        )  # fmt: skip
        assert regions[name].width < full.width
    fitness = Fitness(body, rig.cameras)
    poses = pose + body.sigma * np.random.default_rng(3).standard_normal((5, body.size))
    evaluate = [
        fitness.prepare(fitness.lay_out(seen), make_comparison(body, pose))
        for seen in (observations, regions)
    ]
    assert evaluate[0](poses).tobytes() == evaluate[1](poses).tobytes()


def test_a_missing_camera_leaves_the_mean_of_the_others(
    body, rig, pose, observations, make_comparison
):
    fitness = Fitness(body, rig.cameras)
    full = fitness.terms(fitness.lay_out(observations), pose)
    missing = rig.names[1]
    del observations[missing]
    views = fitness.lay_out(observations)
    terms = fitness.terms(views, pose)
    assert terms == {name: full[name] for name in rig.names if name != missing}
    cost = fitness.prepare(views, make_comparison(body, pose))(pose[None])[0]
    mean = np.mean([t.silhouette + t.edges for t in terms.values()])
    assert cost == pytest.approx(2.0 - mean, abs=1e-12)


def test_observations_without_a_known_camera_are_refused(body, rig, observations):
    fitness = Fitness(body, rig.cameras)
    with pytest.raises(ImageError, match="no view to compare with"):
        fitness.lay_out({})
    with pytest.raises(ImageError, match="no view to compare with"):
        fitness.lay_out({"other": observations[rig.names[0]]})


def test_cameras_of_different_sizes_share_the_working_memory(
    twin, make_observation, body, rig, pose
):
    """A frame beside smaller and larger ones costs the same as alone."""
    sizes = [(320, 240), (96, 130), (200, 60)]
    cameras = [c.resized(size) for c, size in zip(rig.cameras[:3], sizes, strict=True)]
    seen = {c.name: make_observation(c, twin(body, c, pose).silhouette()) for c in cameras}
    together = Fitness(body, cameras)
    terms = together.terms(together.lay_out(seen), pose)
    for camera in cameras:
        alone = Fitness(body, [camera])
        views = alone.lay_out({camera.name: seen[camera.name]})
        assert alone.terms(views, pose)[camera.name] == terms[camera.name]
        assert terms[camera.name].silhouette > 0.9


def test_turning_the_world_and_the_cameras_together_changes_nothing(
    make_pose, body, rig, observations
):
    """Only the position relative to the cameras matters."""
    pose = make_pose(body, np.random.default_rng(4), spread_m=0.2)
    turn, shift = rotation_from_rodrigues([0, 0, 0.7]), np.array([1.0, -2.0, 0.3])
    moved_world = transform(turn, shift)
    cameras = [replace(c, T_cam_world=c.T_cam_world @ np.linalg.inv(moved_world)) for c in rig]
    moved = pose.copy()
    at = [body.index(f"pelvis_t{axis}") for axis in "xyz"]
    moved[at] = turn @ pose[at] + shift
    moved[body.index("pelvis_rz")] += 0.7
    for a, b in zip(
        *(
            f.count(f.lay_out(observations), p[None].copy(), *2 * [np.ones(10, bool)])[0]
            for f, p in ((Fitness(body, rig.cameras), pose), (Fitness(body, cameras), moved))
        ),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, atol=2.0, rtol=1e-3)
