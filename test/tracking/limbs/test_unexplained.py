"""Limbs named by silhouette that the body does not cover."""

import numpy as np
import pytest

from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.limbs.unexplained import find_unexplained


@pytest.fixture(scope="module")
def standing():
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
    return scene, scene.frame(0)[2]


def observed(scene, pose, undecided=None):
    masks = body_masks(scene.body, pose, scene.rig.cameras)
    seen = {}
    for name, mask in masks.items():
        hidden = np.zeros_like(mask) if undecided is None else undecided[name]
        seen[name] = Observation.from_mask(
            name, 0, mask & ~hidden, np.zeros(mask.shape, np.uint8), undecided=hidden
        )
    return seen


def raised(scene, pose, limb, angle=2.0):
    changed = pose.copy()
    name = {"arm": "shoulder_y", "leg": "hip_x"}[limb[2:]]
    changed[scene.body.index(f"{limb[0]}_{name}")] += angle
    return changed


@pytest.mark.parametrize("limb", ["l_arm", "r_arm"])
def test_an_arm_raised_in_the_silhouette_is_named(standing, limb) -> None:
    """The body's arm hangs."""
    scene, pose = standing
    seen = observed(scene, raised(scene, pose, limb))
    assert next(iter(find_unexplained(scene.body, pose, seen, scene.rig).areas_m2)) == limb


def test_a_body_that_covers_its_silhouette_names_none(standing) -> None:
    scene, pose = standing
    assert not find_unexplained(scene.body, pose, observed(scene, pose), scene.rig).areas_m2


def test_undecided_pixels_name_none(standing) -> None:
    scene, pose = standing
    up = raised(scene, pose, "l_arm")
    there = body_masks(scene.body, up, scene.rig.cameras)
    here = body_masks(scene.body, pose, scene.rig.cameras)
    hidden = {name: mask & ~here[name] for name, mask in there.items()}
    assert not find_unexplained(scene.body, pose, observed(scene, up, hidden), scene.rig).areas_m2


def test_a_region_names_the_same(standing) -> None:
    scene, pose = standing
    cut = {}
    for name, seen in observed(scene, raised(scene, pose, "l_arm")).items():
        region = np.s_[7:240, 30:320]
        assert seen.mask.sum() == seen.mask[region].sum()
        cut[name] = Observation.from_mask(
            name, 0, np.ascontiguousarray(seen.mask[region]), np.zeros((233, 290), np.uint8),
            size_px=seen.size_px, offset_px=(30, 7),
        )  # fmt: skip
    assert next(iter(find_unexplained(scene.body, pose, cut, scene.rig).areas_m2)) == "l_arm"


def test_every_limb_that_is_long_enough_is_named_after_the_nearest(standing) -> None:
    scene, pose = standing
    seen = observed(scene, raised(scene, pose, "l_arm"))
    found = find_unexplained(scene.body, pose, seen, scene.rig)
    assert next(iter(found.areas_m2)) == "l_arm"
    kick = observed(scene, raised(scene, pose, "l_leg", 0.7))
    assert {"l_leg", "r_leg"} <= set(find_unexplained(scene.body, pose, kick, scene.rig).areas_m2)
    for name, region in found.regions.items():
        assert region.any() and not (region & ~seen[name].mask).any()
