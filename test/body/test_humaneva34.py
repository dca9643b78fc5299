"""The bodies of 34 parameters: published names and counts, signs, sizes."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import (
    MARKER_NAMES,
    Feasibility,
    cone_transforms,
    load_body,
    markers,
    pose_from_markers,
    transforms,
)
from markerless_tracker.body.urdf import urdf

BODIES = {name: load_body(name, 1.75) for name in ("humaneva34", "person34")}
PEERS = {"humaneva34": load_body("balan31", 1.75), "person34": load_body("person35", 1.75)}
BODY = BODIES["humaneva34"]
JOINTS = {
    "pelvis": 6, "torso": 3, "head": 1, "clavicle": 4, "shoulder": 6, "elbow": 2, "wrist": 2,
    "hip": 6, "knee": 2, "foot": 2,
}  # fmt: skip

pytestmark = pytest.mark.parametrize("name", BODIES)


def at(body, pose):
    return dict(zip(MARKER_NAMES, markers(body, pose), strict=True))


def tip(body, pose, cone):
    place = cone_transforms(body, pose)[body.cone_names.index(cone)]
    return place[:, :3] @ [0.0, 0.0, body.cone_length[body.cone_names.index(cone)]] + place[:, 3]


def bent(body, **angles):
    pose = body.neutral.copy()
    for joint, angle in angles.items():
        pose[body.index(joint)] += angle
    return pose


def test_34_parameters_of_eq_8(name) -> None:
    body = BODIES[name]
    assert body.size == 34
    counts = {
        joint: sum(joint in parameter for parameter in body.parameter_names) for joint in JOINTS
    }
    assert counts == JOINTS


def test_parts(name) -> None:
    limbs = {f"{s}_{p}" for s in "lr" for p in
             ("upper_arm", "forearm", "hand", "thigh", "calf", "foot")}  # fmt: skip
    found = set(BODIES[name].cone_names)
    if name == "humaneva34":
        assert found == {"pelvis", "torso", "head"} | limbs and len(found) == 15
    else:
        assert found == set(PEERS[name].cone_names) and limbs < found


def test_hierarchies_partition_the_parameters(name) -> None:
    body = BODIES[name]
    sizes = {step[0]: body.subspaces[step[0]].size for step in body.steps("six")}
    assert sizes == {"root": 6, "torso_head": 4, "l_arm": 7, "r_arm": 7, "l_leg": 5, "r_leg": 5}
    for hierarchy in ("six", "twelve"):
        members = np.concatenate([body.subspaces[s[0]] for s in body.steps(hierarchy)])
        assert sorted(members) == list(range(34))
    assert body.limbs == ("l_arm", "r_arm", "l_leg", "r_leg")


def test_neutral_equals_that_of_31_parameters(name) -> None:
    body, peer = BODIES[name], PEERS[name]
    np.testing.assert_allclose(markers(body, body.neutral), markers(peer, peer.neutral), atol=1e-12)
    # The published spheres are wider than a person's legs.
    for rule in ("elliptic",) if name == "person34" else ("elliptic", "published"):
        assert Feasibility(body, body.limits, rule)(body.neutral[None])[0]
    if name == "person34":
        ours, theirs = (
            np.sort([tip(b, b.neutral, c) for c in body.cone_names if c[1] == "_"], axis=0)
            for b in (body, peer)
        )
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_at_zero_every_joint_frame_is_x_forward_y_left_z_up(name) -> None:
    body = BODIES[name]
    nodes = transforms(body, np.zeros(34))
    if name == "person34":
        # At zero its limbs point to the middle of their joints' ranges.
        nodes = transforms(body, body.neutral)
    for frame, node in body.frames.items():
        if "clavicle" in frame:
            continue
        if name == "person34" and frame[1:] in ("_shoulder", "_elbow", "_wrist"):
            tilt = np.degrees(np.arccos(nodes[node][2, 2]))
            assert tilt == pytest.approx(6.0)
        else:
            np.testing.assert_allclose(nodes[node][:, :3], np.eye(3), atol=1e-12, err_msg=frame)


@pytest.mark.parametrize("side", ["l", "r"])
def test_positive_angles_flex_forward_and_abduct_outward(name, side) -> None:
    body, letter = BODIES[name], side.upper()
    out = 1.0 if side == "l" else -1.0
    rest = at(body, body.neutral)

    def moved(marker, **angles):
        return at(body, bent(body, **angles))[f"{letter}{marker}"] - rest[f"{letter}{marker}"]

    # A raised arm of person34 points forward and outward.
    assert moved("Wrist", **{f"{side}_shoulder_y": 0.4})[0] > 0.1
    assert out * moved("Wrist", **{f"{side}_shoulder_x": 0.4})[1] > 0.05
    assert moved("Wrist", **{f"{side}_elbow": 0.4})[0] > 0.05
    assert moved("Ankle", **{f"{side}_hip_y": 0.4})[0] > 0.1
    assert out * moved("Ankle", **{f"{side}_hip_x": 0.4})[1] > 0.1
    # A knee bends backward, with negative angles.
    assert moved("Ankle", **{f"{side}_knee": -0.4})[0] < -0.05
    for joint, cone, axis in (("foot", "foot", 2), ("wrist", "hand", 0)):
        lifted = tip(body, bent(body, **{f"{side}_{joint}": 0.3}), f"{side}_{cone}")
        assert lifted[axis] - tip(body, body.neutral, f"{side}_{cone}")[axis] > 0.01
    np.testing.assert_allclose(moved("Ankle", **{f"{side}_foot": 0.3}), 0.0, atol=1e-12)


def test_feet_point_forward_and_hands_down(name) -> None:
    body = BODIES[name]
    rest = at(body, body.neutral)
    for side in "lr":
        assert tip(body, body.neutral, f"{side}_foot")[0] > rest["LAnkle"][0] + 0.15
        wrist = rest[f"{side.upper()}Wrist"]
        assert tip(body, body.neutral, f"{side}_hand")[2] < wrist[2] - 0.1


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_poses_are_recovered_from_their_markers(name, seed) -> None:
    """A pose of the 31-parameter body, near enough to neutral; wrists and feet stay at zero."""
    body, peer = BODIES[name], PEERS[name]
    pose = peer.neutral.copy()
    pose[peer.joints] += np.random.default_rng(seed).uniform(-0.25, 0.25, peer.joints.size)
    # This body's head does not nod.
    pose[[peer.index(f"head_{axis}") for axis in "xyz"]] = 0.0
    pose = np.clip(pose, *peer.limits)
    shown = at(peer, pose)
    fitted = pose_from_markers(body, shown)
    gap = np.linalg.norm(markers(body, fitted) - markers(peer, pose), axis=1)
    assert gap.max() < 0.02
    undetermined = [body.index(f"{side}_{joint}") for side in "lr" for joint in ("wrist", "foot")]
    np.testing.assert_allclose(fitted[undetermined], 0.0, atol=1e-9)


def test_a_urdf_with_as_many_joints(name) -> None:
    body = BODIES[name]
    robot = ElementTree.fromstring(urdf(body))
    moving = [j for j in robot.findall("joint") if j.get("type") != "fixed"]
    assert len([j for j in moving if j.find("mimic") is None]) == 28
    assert {v.get("name") for v in robot.iter("visual")} == set(body.cone_names)
