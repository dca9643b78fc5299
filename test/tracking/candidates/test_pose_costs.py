"""Costs of improbable limbs and of arms in the trunk, against slow twins and known postures."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, BodyModel, cone_transforms, load_body, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.tracking.candidates import pose_costs as module
from markerless_tracker.tracking.candidates.mirror import mirror_of
from markerless_tracker.tracking.candidates.pose_costs import (
    CORE,
    LIMB_COST,
    MOST,
    TRUNK_COST,
    USUAL,
    arms_in_trunk,
    pose_costs,
    unusual_limbs,
)
from markerless_tracker.tracking.candidates.postures import POSTURES, postures

BODY = load_body("person32", 1.75)


def twin(body: BodyModel, pose: np.ndarray, trunk: list[str]) -> float:
    """Cost of the arms of one pose in the named cones, point by point."""
    joints = dict(zip(MARKER_NAMES, markers(body, pose), strict=True))
    placed = cone_transforms(body, pose)
    shares = []
    for side in "LR":
        shoulder, elbow, wrist = (joints[side + n] for n in ("Shoulder", "Elbow", "Wrist"))
        points = [shoulder + t * (elbow - shoulder) for t in (0.5, 0.75, 1.0)]
        points += [elbow + t * (wrist - elbow) for t in (0.25, 0.5, 0.75, 1.0)]
        for point in points:
            parts = [CORE]
            for name in trunk:
                c = body.cone_names.index(name)
                x, y, z = placed[c, :, :3].T @ (point - placed[c, :, 3])
                t = z / body.cone_length[c]
                if 0.0 <= t <= 1.0:
                    rx, ry, ox, oy = (1 - t) * body.cone_shape[c, 0] + t * body.cone_shape[c, 1]
                    parts.append(float(np.hypot((x - ox) / rx, (y - oy) / ry)))
            shares.append(1.0 - min(parts) / CORE)
    return TRUNK_COST * float(np.mean(shares))


def test_arms_in_the_trunk_cost_what_their_points_do() -> None:
    rng = np.random.default_rng(4)
    poses = np.tile(BODY.neutral, (40, 1))
    arms = BODY.subspaces["arms"]
    poses[:, arms] += 1.2 * rng.standard_normal((40, len(arms)))
    trunk = [n for n in BODY.cone_names if n in ("pelvis", "belly", "chest")]
    assert [BODY.cone_names[c] for c in module._trunk(BODY)] == trunk
    costs = arms_in_trunk(BODY, poses)
    np.testing.assert_allclose(costs, [twin(BODY, pose, trunk) for pose in poses], atol=1e-12)
    assert (costs > 0.0).sum() > 3 and (costs == 0.0).sum() > 3


def test_both_arms_in_the_trunk_cost_twice_as_much_as_one() -> None:
    left = BODY.subspaces["l_arm"]
    rng = np.random.default_rng(0)
    tried = np.tile(BODY.neutral, (500, 1))
    tried[:, left] = rng.uniform(*BODY.limits[:, left], (500, len(left)))
    costs = arms_in_trunk(BODY, tried)
    one = tried[int(np.argmax(costs))]
    both = one.copy()
    right = BODY.subspaces["r_arm"]
    both[right] = mirror_of(BODY).of(one)[right]
    assert costs.max() > 0.02
    assert arms_in_trunk(BODY, both[None])[0] == pytest.approx(2.0 * costs.max(), rel=0.05)


@pytest.mark.parametrize("number", range(len(POSTURES)))
def test_known_postures_have_no_arm_in_the_trunk(number: int) -> None:
    assert arms_in_trunk(BODY, postures(BODY)[[number]])[0] < 0.005


def test_people_who_stand_or_walk_cost_nothing() -> None:
    step = {"l_hip_y": 0.4, "r_hip_y": -0.3, "l_knee": 0.3, "l_elbow": 0.5}
    known = BODY.prior_mean.copy()
    assert unusual_limbs(BODY, known[None])[0] == 0.0
    assert pose_costs(BODY, posture(BODY, step)[None])[0] < 0.005


def test_a_limb_far_from_the_mean_costs_up_to_a_limit() -> None:
    arm = BODY.index("l_elbow")
    costs = []
    for sd in (0.0, 1.9, 2.1, 3.0, 9.0, 20.0):
        pose = BODY.prior_mean.copy()
        pose[arm] -= sd * BODY.prior_sd[arm]
        costs.append(float(unusual_limbs(BODY, pose[None])[0]))
    assert costs[:2] == [0.0, 0.0] and costs[2] > 0.0
    assert costs[3] == pytest.approx(LIMB_COST * (4.5 - USUAL))
    assert costs[4] == costs[5] == pytest.approx(LIMB_COST * MOST)


def test_where_the_person_stands_and_faces_costs_nothing() -> None:
    rng = np.random.default_rng(1)
    pose = BODY.neutral.copy()
    pose[BODY.subspaces["arms"]] += rng.standard_normal(len(BODY.subspaces["arms"]))
    moved = pose.copy()
    moved[[BODY.index("pelvis_tx"), BODY.index("pelvis_rz")]] += (1.3, 2.0)
    before, after = pose_costs(BODY, np.array([pose, moved]))
    assert before > 0.0 and after == pytest.approx(before, abs=1e-12)


@pytest.mark.parametrize("name", ["balan31", "person35", "humaneva34"])
def test_other_bodies_have_a_trunk(name: str) -> None:
    body = load_body(name, 1.75)
    assert len(module._trunk(body)) >= 1
    assert pose_costs(body, body.neutral[None])[0] < 0.01
