"""Ball joints as a swing and a twist: grammar, round trips, derivatives, no singularity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from markerless_tracker.body import load_body, markers, transforms
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.angles.swing import set_rotation, split, swing_joints, twists
from markerless_tracker.body.description import parse_chain
from markerless_tracker.body.kinematics import move_axes, moving_nodes
from markerless_tracker.body.model import SWING_X, SWING_Y
from markerless_tracker.errors import BodyModelError

BODIES = {name: load_body(name, 1.75) for name in ("person31", "person34", "person35")}
PUBLISHED = {"person31": "balan31"}
BALLS = ("l_hip", "r_hip", "l_shoulder", "r_shoulder")
SEEDS = st.integers(0, 2**32 - 1)
STANDING = {"l_elbow": 0.1, "r_elbow": 0.1, "l_knee": 0.05, "r_knee": 0.05}
HABITUAL = {
    "standing": STANDING,
    "forward": {"l_shoulder_y": 1.57, "r_shoulder_y": 1.57},
    "sideways": {"l_shoulder_x": 1.57, "r_shoulder_x": 1.57},
    "overhead": {"l_shoulder_y": 3.0, "r_shoulder_y": 3.0},
    "overhead sideways": {"l_shoulder_x": 2.9, "r_shoulder_x": 2.9},
    "backward": {"l_shoulder_y": -0.9, "r_shoulder_y": -0.9, "l_hip_y": -0.4, "r_hip_y": -0.4},
    "across": {"l_shoulder_y": 1.2, "r_shoulder_y": 1.2, "l_shoulder_x": -0.5,
               "r_shoulder_x": -0.5},
    "sitting": {"l_hip_y": 1.5, "r_hip_y": 1.5, "l_knee": 1.5, "r_knee": 1.5},
    "squat": {"l_hip_y": 2.0, "r_hip_y": 2.0, "l_hip_x": 0.3, "r_hip_x": 0.3},
    "split": {"l_hip_x": 0.8, "r_hip_x": 0.8},
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_hips_and_shoulders_swing_and_twist(name) -> None:
    body = BODIES[name]
    assert set(swing_joints(body)) == set(BALLS)
    assert {body.parameter_names[i] for i in twists(body)} == {f"{ball}_z" for ball in BALLS}
    assert swing_joints(load_body("balan31")) == swing_joints(load_body("humaneva34")) == ()


def test_a_swing_is_the_rotation_by_its_vector() -> None:
    body = BODIES["person31"]
    node = body.frames["l_hip"]
    second = int(body.node_parent[node])
    first = int(body.node_parent[second])
    assert body.node_kind[first] == SWING_X and body.node_kind[second] == SWING_Y
    for a, b in ((0.0, 0.0), (1e-9, -2e-9), (1e-4, 2e-4), (0.7, -1.1), (2.0, 2.0)):
        pose = body.neutral.copy()
        for at, value in ((first, a), (second, b)):
            pose[body.node_parameter[at]] = value / body.node_sign[at]
        nodes = transforms(body, pose)
        turned = nodes[first, :, :3].T @ nodes[second, :, :3]
        expected = Rotation.from_rotvec([a, b, 0.0]).as_matrix()
        np.testing.assert_allclose(turned, expected, atol=1e-12)


@settings(max_examples=100, deadline=None)
@given(SEEDS)
def test_rotations_are_split_and_joined(seed) -> None:
    rng = np.random.default_rng(seed)
    swing = rng.uniform(-2.2, 2.2, 2)
    twist = rng.uniform(-3.1, 3.1)
    whole = Rotation.from_rotvec([*swing, 0.0]) * Rotation.from_rotvec([0.0, 0.0, twist])
    if np.linalg.norm(swing) < 3.1:
        np.testing.assert_allclose(split(whole.as_matrix()), [*swing, twist], atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.sampled_from(sorted(BODIES)), st.sampled_from(BALLS))
def test_any_rotation_of_a_joint_can_be_set(seed, name, joint) -> None:
    body = BODIES[name]
    rotation = Rotation.random(random_state=seed).as_matrix()
    pose = body.neutral.copy()
    set_rotation(body, pose, joint, rotation)
    node = body.frames[joint]
    rest, moved = (transforms(body, p)[node, :, :3] for p in (body.neutral, pose))
    np.testing.assert_allclose(moved, rest @ rotation, atol=1e-9)


@pytest.mark.parametrize("name", BODIES)
@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_axes_are_the_derivatives_of_the_transforms(name, seed) -> None:
    body = BODIES[name]
    rng = np.random.default_rng(seed)
    pose = body.neutral + rng.uniform(-1.0, 1.0, body.size)
    nodes = transforms(body, pose)
    moved = np.flatnonzero(body.node_kind >= 0)
    axes = move_axes(body, nodes, moved)
    step = 1e-6
    for node, axis in zip(moved, axes, strict=True):
        if 3 <= body.node_kind[node] < SWING_X:
            continue
        shift = np.zeros(body.size)
        shift[body.node_parameter[node]] = step
        low, high = (transforms(body, pose + s * shift) for s in (-1.0, 1.0))
        # The whole swing moves with its first parameter.
        at = node + 1 if body.node_kind[node] == SWING_X else node
        turn = high[at, :, :3] @ low[at, :, :3].T
        found = Rotation.from_matrix(turn).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(found, axis, atol=1e-7)


def test_both_parameters_of_a_swing_move_the_limb() -> None:
    body = BODIES["person31"]
    for axis in "xyz":
        moves = moving_nodes(body, np.array([body.index(f"l_hip_{axis}")]))
        assert moves[body.frames["l_hip"]] and moves[body.frames["l_knee"]]
        assert not moves[body.frames["r_hip"]]


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("habit", HABITUAL)
def test_no_singularity_where_people_are(name, habit) -> None:
    """Three parameters of a ball joint turn its limb about three well-separated axes."""
    body = BODIES[name]
    pose = posture(body, HABITUAL[habit])
    assert ((body.limits[0] <= pose) & (pose <= body.limits[1])).all()
    nodes = transforms(body, pose)
    for joint in BALLS:
        twist = body.frames[joint]
        axes = move_axes(body, nodes, np.array([twist - 2, twist - 1, twist]))
        assert np.linalg.svd(axes)[1].min() > 0.3, joint


def test_postures_are_those_of_the_published_body() -> None:
    """At the same anatomical angles the limbs point to where the published body's do."""
    mine, published = BODIES["person31"], load_body("balan31", 1.75)
    for angles in HABITUAL.values():
        a, b = (transforms(body, posture(body, angles)) for body in (mine, published))
        for limb in ("l_hip", "r_knee"):
            mine_axes, axes = a[mine.frames[limb]], b[published.frames[limb]]
            np.testing.assert_allclose(mine_axes[:, :3], axes[:, :3], atol=1e-9)


def test_raised_arms_of_all_bodies_agree() -> None:
    for angles in ({"l_shoulder_y": 1.2, "r_shoulder_y": 0.4, "l_shoulder_x": 0.3}, {}):
        expected = markers(BODIES["person31"], posture(BODIES["person31"], angles))
        for body in BODIES.values():
            np.testing.assert_allclose(markers(body, posture(body, angles)), expected, atol=1e-9)


@pytest.mark.parametrize("chain", ["sx(a)", "sy(b)", "sy(b) sx(a)", "sx(a) rz(c) sy(b)"])
def test_half_a_swing_is_an_error(chain) -> None:
    with pytest.raises(BodyModelError, match="sx.first. sy.second. together"):
        parse_chain(chain, "frame")
