"""Populations of one frame: any number of threads, costs, generations, exchanged limbs."""

from collections.abc import Mapping

import numpy as np
import pytest

from markerless_tracker.body import (
    cone_transforms,
    load_body,
    markers,
    markers_of_many,
    transforms_of_many,
)
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness.contour import SPACING_M, ContourFrame
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.candidates.crossed import PAIRS
from markerless_tracker.tracking.candidates.mirror import mirror_of
from markerless_tracker.tracking.candidates.population import FramePopulation, scaled_to
from markerless_tracker.tracking.candidates.postures import POSTURES, postures
from markerless_tracker.tracking.search import make_searcher


def made_up(
    threads: int,
    *,
    blank: bool = False,
    change: Mapping[str, float] | None = None,
    cost: str = "overlap",
) -> tuple[FramePopulation, np.ndarray]:
    """A frame of a made-up person, and the pose (p,) in it.

    Args:
        threads: of the searcher.
        blank: whether the silhouettes are left out.
        change: rad, added to parameters of the pose.
        cost: what swarms minimise.
    """
    scene = SyntheticScene(body="person31", size_px=(256, 192), seed=2)
    pose = scene.motion.pose(0.0)
    for name, angle_rad in (change or {}).items():
        pose[scene.body.index(name)] += angle_rad
    views = scene_views(scene, pose, blank=blank)
    config = TrackerConfig(threads=threads, cost=cost)
    searcher = make_searcher(scene.body, rig=scene.rig, config=config, threads=threads)
    return FramePopulation(searcher, views, 0, pose), pose


def scene_views(
    scene: SyntheticScene, pose: np.ndarray, *, blank: bool = False
) -> dict[str, Observation]:
    nothing = np.zeros((192, 256), np.uint8)
    masks = {c.name: nothing > 0 if blank else silhouette(scene.body, pose, c) for c in scene.rig}
    return {name: Observation.from_mask(name, 0, mask, nothing) for name, mask in masks.items()}


def refined(threads: int) -> np.ndarray:
    frame, pose = made_up(threads)
    rng = np.random.default_rng(1)
    return frame.refined(pose + 0.05 * rng.standard_normal((5, pose.size)), 3, (0.15, 0.05))


def test_the_many_poses_of_a_search_are_refined_on_fewer_outline_points(monkeypatch) -> None:
    """Those that are kept are refined on all of them in the next frame."""
    frame, pose = made_up(1)
    spacings_m, on_contours = [], ContourFrame.refined

    def noted(contours, start, *, spacing_m, **how):
        spacings_m.append(spacing_m)
        return on_contours(contours, start, spacing_m=spacing_m, **how)

    monkeypatch.setattr(ContourFrame, "refined", noted)
    population = frame.initialised(pose[None])
    frame.recombined(population, 0)
    assert len(spacings_m) > 2 and min(spacings_m) > SPACING_M
    spacings_m.clear()
    frame.propagated(population)
    assert set(spacings_m) == {SPACING_M}


def test_refined_poses_are_the_same_with_any_number_of_threads() -> None:
    np.testing.assert_array_equal(refined(1), refined(2))


def test_feet_above_the_floor_stay_there_since_the_size_is_unknown() -> None:
    frame, pose = made_up(1, blank=True)
    up = load_body("person31", 1.75).index("pelvis_tz")
    pose[up] += 0.05
    assert frame.refined(pose[None], 3, (0.15, 0.05))[0, up] == pytest.approx(pose[up], abs=1e-6)


def test_a_limbs_costs_are_those_of_the_whole_body() -> None:
    frame, pose = made_up(1)
    limb = load_body("person31", 1.75).subspaces["l_arm"]
    poses = np.tile(pose, (20, 1))
    poses[:, limb] += 0.5 * np.random.default_rng(2).standard_normal((20, len(limb)))
    costs = frame.costs(poses)
    np.testing.assert_allclose(
        frame.limb_costs(pose, limb)(poses[:, limb]), costs, rtol=0, atol=1e-12
    )
    assert costs.std() > 1e-3


def test_many_poses_at_once_are_placed_as_one_by_one() -> None:
    body = SyntheticScene(body="person31", seed=2).body
    poses = postures(body)
    assert poses.shape == (len(POSTURES), body.size)
    np.testing.assert_allclose(
        markers_of_many(body, poses), [markers(body, pose) for pose in poses], atol=1e-12
    )
    cones = transforms_of_many(body, poses)[:, body.cone_node]
    np.testing.assert_allclose(
        np.matmul(cones[..., :3], body.cone_fixed[:, :, 3:])[..., 0] + cones[..., 3],
        [cone_transforms(body, pose)[:, :, 3] for pose in poses],
        atol=1e-12,
    )


@pytest.mark.parametrize("pair", PAIRS)
def test_exchanged_legs_and_arms_are_found(pair: str) -> None:
    raised = {"legs": {"hip_y": -0.9}, "arms": {"shoulder_y": 1.0, "elbow": 0.6}}
    frame, pose = made_up(1, change={f"l_{n}": v for n, v in raised[pair].items()})
    body = SyntheticScene(body="person31", seed=2).body
    wrong = pose.copy()
    own = body.subspaces[pair]
    wrong[own] = mirror_of(body).of(pose)[own]
    population = frame.selected(frame.refined(wrong[None], 5, (0.15, 0.05)))

    def error_m(found: np.ndarray) -> float:
        return float(np.linalg.norm(markers(body, found) - markers(body, pose), axis=1).max())

    assert error_m(population.poses[0]) > 0.3
    better = frame.with_exchanged_pairs(population, 7)
    assert error_m(better.poses[0]) < 0.1
    assert better.costs[0] < population.costs[0]


def test_limbs_in_their_own_places_stay() -> None:
    frame, pose = made_up(1, change={"l_hip_y": -0.9, "r_shoulder_y": 1.0})
    population = frame.selected(frame.refined(pose[None], 5, (0.15, 0.05)))
    kept = frame.with_exchanged_pairs(population, 7)
    np.testing.assert_array_equal(kept.poses[0], population.poses[0])


@pytest.mark.parametrize("cost", ["bidirectional", "one_sided"])
def test_costs_are_those_of_f_s_whatever_swarms_minimise(cost: str) -> None:
    (plain, pose), (frame, _) = made_up(1), made_up(1, cost=cost)
    poses = np.stack([pose, pose + 0.05])
    np.testing.assert_array_equal(frame.costs(poses), plain.costs(poses))
    limb = load_body("person31", 1.72).subspaces["l_arm"]
    np.testing.assert_array_equal(
        frame.limb_costs(pose, limb)(poses[:, limb]), plain.limb_costs(pose, limb)(poses[:, limb])
    )


def test_what_another_search_found_with_another_size_is_compared() -> None:
    """The better of two searches is kept, whichever it is."""
    frame, pose = made_up(1)
    scene = SyntheticScene(body="person31", size_px=(256, 192), seed=2)
    body = load_body("person31", 1.6)
    searcher = make_searcher(body, rig=scene.rig, config=TrackerConfig(threads=1), threads=1)
    other = FramePopulation(searcher, scene_views(scene, pose), 0, pose)
    wrong = pose.copy()
    wrong[load_body("person31", 1.75).index("l_hip_y")] -= 0.9
    poor = frame.selected(wrong[None])
    found = other.selected(scaled_to(scene.body, body, pose[None]))
    both = frame.with_found(poor, other, found)
    assert both.costs[0] < poor.costs[0] - 0.02
    gap = np.linalg.norm(markers(scene.body, both.poses[0]) - markers(scene.body, pose), axis=1)
    assert gap.max() < 0.05
    np.testing.assert_array_equal(both.poses[-1], wrong)
