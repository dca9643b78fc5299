"""Draws of a limb that reach into unexplained regions of silhouette."""

import numpy as np
import pytest

from markerless_tracker.body import cone_transforms
from markerless_tracker.camera import project_camera
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.limbs.aimed import ALONG, most_aimed


@pytest.fixture(scope="module")
def standing():
    """A scene, poses with the left arm drawn anew, and the regions where the last one has it."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
    pose, arm = scene.frame(0)[2], scene.body.subspaces["l_arm"]
    poses = np.tile(pose, (40, 1))
    poses[:, arm] += np.random.default_rng(0).normal(0.0, 0.4, (40, len(arm)))
    poses[-1] = pose
    poses[-1, scene.body.index("l_shoulder_x")] += 2.0
    raised = body_masks(scene.body, poses[-1], scene.rig.cameras)
    plain = body_masks(scene.body, pose, scene.rig.cameras)
    return scene, poses, {name: mask & ~plain[name] for name, mask in raised.items()}


def slow_hits(scene, pose, regions) -> int:
    """Points of the left arm's cones that lie in regions."""
    placed, hits = cone_transforms(scene.body, pose), 0
    for cone, name in enumerate(scene.body.cone_names):
        if name not in ("l_deltoid", "l_upper_arm", "l_forearm", "l_hand"):
            continue
        steps = ALONG[:, None] * scene.body.cone_length[cone]
        points = placed[cone, :, 3] + steps * placed[cone, :, 2]
        for view, region in regions.items():
            for u, v in np.round(project_camera(points, scene.rig[view])).astype(int):
                inside = 0 <= u < region.shape[1] and 0 <= v < region.shape[0]
                hits += inside and bool(region[v, u])
    return hits


def test_draws_are_ordered_by_how_far_they_reach_into_the_regions(standing) -> None:
    scene, poses, regions = standing
    limb = scene.body.subspaces["l_arm"]
    found = most_aimed(scene.body, poses, 40, limb=limb, regions=regions, rig=scene.rig)
    hits = [slow_hits(scene, pose, regions) for pose in poses]
    expected = [i for i in np.argsort(np.negative(hits), kind="stable") if hits[i]]
    np.testing.assert_array_equal(found, poses[expected])
    np.testing.assert_array_equal(found[0], poses[-1])
    few = most_aimed(scene.body, poses, 2, limb=limb, regions=regions, rig=scene.rig)
    np.testing.assert_array_equal(few, found[:2])


def test_draws_that_reach_nowhere_are_left_out(standing) -> None:
    scene, poses, regions = standing
    nothing = {name: np.zeros_like(region) for name, region in regions.items()}
    limb = scene.body.subspaces["l_arm"]
    found = most_aimed(scene.body, poses, 40, limb=limb, regions=nothing, rig=scene.rig)
    assert found.shape == (0, scene.body.size)
