"""person35: person31 with ankles and wrists."""

import numpy as np
import pytest

from markerless_tracker.body import Feasibility, cone_transforms, load_body, markers

JOINTS = ("l_ankle", "r_ankle", "l_wrist", "r_wrist")


@pytest.fixture(scope="module")
def bodies():
    return load_body("person31", 1.75), load_body("person35", 1.75)


def test_it_is_person31_with_four_more_joints(bodies) -> None:
    plain, jointed = bodies
    assert jointed.parameter_names == (*plain.parameter_names, *JOINTS)
    assert jointed.cone_names == plain.cone_names
    rng = np.random.default_rng(0)
    pose = plain.neutral + rng.uniform(-0.3, 0.3, plain.size)
    longer = np.append(pose, np.zeros(4))
    np.testing.assert_allclose(markers(jointed, longer), markers(plain, pose), atol=1e-12)
    np.testing.assert_allclose(
        cone_transforms(jointed, longer), cone_transforms(plain, pose), atol=1e-12
    )


@pytest.mark.parametrize("side", ["l", "r"])
def test_a_positive_ankle_lifts_the_toes_and_moves_no_marker(bodies, side) -> None:
    body = bodies[1]
    bent = body.neutral.copy()
    bent[body.index(f"{side}_ankle")] = 0.3
    foot = body.cone_names.index(f"{side}_foot")

    def toe(pose):
        placed = cone_transforms(body, pose)[foot]
        return placed[:, :3] @ [0.0, 0.0, body.cone_length[foot]] + placed[:, 3]

    assert toe(bent)[2] > toe(body.neutral)[2] + 0.02
    np.testing.assert_allclose(markers(body, bent), markers(body, body.neutral), atol=1e-12)


@pytest.mark.parametrize("side", ["l", "r"])
def test_a_positive_wrist_flexes_the_palm_inwards(bodies, side) -> None:
    body = bodies[1]
    bent = body.neutral.copy()
    bent[body.index(f"{side}_wrist")] = 0.3
    hand = body.cone_names.index(f"{side}_hand")

    def tip(pose):
        placed = cone_transforms(body, pose)[hand]
        return placed[:, :3] @ [0.0, 0.0, body.cone_length[hand]] + placed[:, 3]

    assert abs(tip(bent)[1]) < abs(tip(body.neutral)[1]) - 0.01


def test_standing_is_feasible(bodies) -> None:
    body = bodies[1]
    assert Feasibility(body, body.limits, "elliptic")(body.neutral[None])[0]
