"""New poses from good ones."""

import numpy as np

from markerless_tracker.body import load_body
from markerless_tracker.tracking.candidates.mirror import Mirror
from markerless_tracker.tracking.candidates.postures import POSTURES, postures
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits


def test_some_children_take_an_arm_of_the_other_side_or_of_a_posture() -> None:
    """A parent with the left arm overhead and the right one down."""
    body = load_body("person31", 1.7)
    overhead = [k for k, angles in enumerate(POSTURES) if angles.get("l_shoulder_y", 0.0) > 2.5]
    assert len(overhead) == 1
    parent = body.neutral.copy()
    left, right = body.subspaces["l_arm"], body.subspaces["r_arm"]
    parent[left] = postures(body)[overhead[0]][left]
    limits = joint_limits(body, TrackerConfig())
    children = Recombiner(body, limits).children(parent[None], 480, np.random.default_rng(0))
    wanted = np.clip(Mirror(body).of(parent), *limits)[right]
    near = np.abs(children[:, right] - wanted).max(axis=1) < 0.6
    assert near.sum() >= 5
