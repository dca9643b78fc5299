"""The fractions of limbs inside the silhouettes."""

import numpy as np

from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.limbs.inside import inside_fractions
from markerless_tracker.tracking.loss import LIMB_LOST_BELOW, LIMB_REGAINED_ABOVE


def test_fractions_tell_the_limb_that_is_off() -> None:
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    raised = pose.copy()
    raised[scene.body.index("l_shoulder_y")] += 2.0
    true = inside_fractions(scene.body, pose, seen, scene.rig)
    assert set(true) == {"l_arm", "r_arm", "l_leg", "r_leg"}
    assert min(true.values()) > 0.9
    wrong = inside_fractions(scene.body, raised, seen, scene.rig)
    assert wrong["l_arm"] < LIMB_LOST_BELOW
    assert wrong["r_arm"] == true["r_arm"] > LIMB_REGAINED_ABOVE
