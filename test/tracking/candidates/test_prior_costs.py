"""Costs of limbs by their prior, against a slow twin and known postures."""

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body
from markerless_tracker.body.anatomy import posture
from markerless_tracker.tracking.candidates.postures import POSTURES, postures
from markerless_tracker.tracking.candidates.prior_costs import COST, MOST, POSTURE, prior_costs

BODY = load_body("person32", 1.75)


def twin(body: BodyModel, pose: np.ndarray) -> float:
    """Cost of one pose, joint by joint."""

    def energy(name: str, mean: np.ndarray) -> float:
        limb = body.subspaces[name]
        return sum(0.5 * ((pose[i] - mean[i]) / body.prior_sd[i]) ** 2 for i in limb)

    def alone(name: str) -> float:
        known = min(POSTURE + energy(name, mean) for mean in postures(body))
        return min(energy(name, body.prior_mean), known, MOST)

    units = 0.0
    for left, right in (("l_arm", "r_arm"), ("l_leg", "r_leg")):
        both = min(energy(left, mean) + energy(right, mean) for mean in postures(body))
        units += min(alone(left) + alone(right), POSTURE + both)
    return COST * units


def test_poses_cost_what_their_limbs_do() -> None:
    rng = np.random.default_rng(3)
    poses = BODY.prior_mean + 0.6 * rng.standard_normal((60, BODY.size))
    poses[30:] = postures(BODY)[rng.integers(len(POSTURES), size=30)]
    poses[30:] += 0.1 * rng.standard_normal((30, BODY.size))
    costs = prior_costs(BODY, poses)
    np.testing.assert_allclose(costs, [twin(BODY, pose) for pose in poses], atol=1e-12)
    assert len(np.unique(costs.round(6))) == 60


def test_the_usual_pose_costs_nothing_and_a_walk_little() -> None:
    step = {"l_hip_y": 0.4, "r_hip_y": -0.3, "l_knee": 0.3, "l_elbow": 0.5}
    assert prior_costs(BODY, BODY.prior_mean[None])[0] == 0.0
    assert prior_costs(BODY, posture(BODY, step)[None])[0] < 3.0 * COST


def test_a_limb_costs_more_the_farther_it_is_up_to_a_limit() -> None:
    elbow = BODY.index("l_elbow")
    costs = []
    for sd in (0.0, 1.0, 2.0, 9.0, 20.0):
        pose = BODY.prior_mean.copy()
        pose[elbow] -= sd * BODY.prior_sd[elbow]
        costs.append(float(prior_costs(BODY, pose[None])[0]))
    assert costs == pytest.approx([0.0, 0.5 * COST, 2.0 * COST, MOST * COST, MOST * COST])


@pytest.mark.parametrize("number", range(len(POSTURES)))
def test_a_limb_as_in_a_known_posture_has_a_fixed_cost(number: int) -> None:
    assert prior_costs(BODY, postures(BODY)[[number]])[0] <= 2.0 * POSTURE * COST + 1e-12


def test_crossed_arms_cost_once_and_a_single_one_as_much() -> None:
    crossed = postures(BODY)[-1].copy()
    legs = [name for name in BODY.limbs if name.endswith("leg")]
    for name in legs:
        crossed[BODY.subspaces[name]] = BODY.prior_mean[BODY.subspaces[name]]
    one = crossed.copy()
    one[BODY.subspaces["r_arm"]] = BODY.prior_mean[BODY.subspaces["r_arm"]]
    assert prior_costs(BODY, np.array([crossed, one])) == pytest.approx([POSTURE * COST] * 2)


def test_where_the_person_stands_and_faces_costs_nothing() -> None:
    rng = np.random.default_rng(1)
    pose = BODY.neutral + 0.3 * rng.standard_normal(BODY.size)
    moved = pose.copy()
    moved[BODY.subspaces["root"]] += 1.3
    before, after = prior_costs(BODY, np.array([pose, moved]))
    assert before > 0.0 and after == before


@pytest.mark.parametrize("name", ["balan31", "person35", "humaneva34"])
def test_other_bodies_have_a_prior(name: str) -> None:
    body = load_body(name, 1.75)
    assert 0.0 <= prior_costs(body, body.neutral[None])[0] < 4.0 * COST
    assert prior_costs(body, body.limits[[1]])[0] > 4.0 * COST


def test_no_poses_have_no_costs() -> None:
    assert prior_costs(BODY, np.empty((0, BODY.size))).shape == (0,)
