"""Reported angles: names, zero, signs, continuity, deviations, the papers' bodies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from markerless_tracker.body import load_body, transforms
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.angles.reader import SPLIT_RAD_S
from markerless_tracker.body.angles.segments import segment_axes, segment_nodes
from markerless_tracker.body.angles.swing import set_rotation

NAMES = ("person31", "person32", "person34", "person35", "balan31", "humaneva34")
BODIES = {name: load_body(name, 1.75) for name in NAMES}
BODY = BODIES["person31"]
STEP_NS = 16_666_667
HINGED = ("l_knee", "r_knee", "l_elbow", "r_elbow")


def read(body, pose):
    return AngleReader(body).read(pose).degrees()


@pytest.mark.parametrize("name", NAMES)
def test_zero_at_the_anatomical_posture(name) -> None:
    angles = read(BODIES[name], BODIES[name].neutral)
    # The neutral arms hang some degrees off the trunk; the world's x is not the ground's.
    free = {"pelvis_rotation", "arm_add_l", "arm_add_r"}
    assert all(abs(v) < 1e-6 for k, v in angles.items() if k not in free)
    assert angles["pelvis_rotation"] == pytest.approx(-90.0)
    assert abs(angles["arm_add_l"]) < 7.0 and angles["arm_add_l"] == pytest.approx(
        angles["arm_add_r"]
    )


def test_a_body_reports_the_joints_that_it_has() -> None:
    counts = {name: len(AngleReader(body).names) for name, body in BODIES.items()}
    assert counts == {
        "person31": 28, "person32": 29, "person34": 31, "person35": 32, "balan31": 28,
        "humaneva34": 31,
    }  # fmt: skip
    assert "ankle_angle_r" not in AngleReader(BODY).names
    assert "ankle_angle_r" in AngleReader(BODIES["person35"]).names
    for body in BODIES.values():
        # As many angles as parameters, the position of the root apart.
        assert len(AngleReader(body).names) == body.size - 3


@pytest.mark.parametrize(
    ("moved", "angle", "sign"),
    [
        ({"r_hip_y": 0.5}, "hip_flexion_r", 1), ({"l_hip_y": 0.5}, "hip_flexion_l", 1),
        ({"r_hip_x": 0.5}, "hip_adduction_r", -1), ({"l_hip_x": 0.5}, "hip_adduction_l", -1),
        ({"r_knee": 0.5}, "knee_angle_r", 1), ({"l_knee": 0.5}, "knee_angle_l", 1),
        ({"r_elbow": 0.5}, "elbow_flex_r", 1), ({"l_elbow": 0.5}, "elbow_flex_l", 1),
        ({"r_shoulder_x": 0.5}, "arm_add_r", -1), ({"l_shoulder_x": 0.5}, "arm_add_l", -1),
        ({"thorax_y": 0.3}, "lumbar_extension", -1), ({"thorax_z": 0.3}, "lumbar_rotation", 1),
        ({"head_y": 0.3}, "neck_extension", 1),
    ],
)  # fmt: skip
def test_signs(moved, angle, sign) -> None:
    """Flexion, adduction, extension of the spine and rotation to the left are positive."""
    for name in ("person31", "person35", "balan31"):
        body = BODIES[name]
        change = read(body, posture(body, moved))[angle] - read(body, body.neutral)[angle]
        assert change == pytest.approx(sign * np.rad2deg(next(iter(moved.values()))), abs=1e-6)


@pytest.mark.parametrize("side", ["l", "r"])
def test_inward_rotation_is_positive(side) -> None:
    """Of a thigh and an upper arm: what lies in front of them moves towards the other side."""
    node = {"hip": BODY.frames[f"{side}_hip"], "shoulder": BODY.frames[f"{side}_shoulder"]}
    for joint, angle in (("hip", "hip_rotation"), ("shoulder", "arm_rot")):
        pose = BODY.neutral.copy()
        pose[BODY.index(f"{side}_{joint}_z")] += 0.4
        forward = [
            transforms(BODY, p)[node[joint], :, :3]
            @ segment_axes(BODY)[f"{side}_{'thigh' if joint == 'hip' else 'upper_arm'}"][:, 0]
            for p in (BODY.neutral, pose)
        ]
        inward = (-1.0 if side == "l" else 1.0) * (forward[1] - forward[0])[1]
        turned = read(BODY, pose)[f"{angle}_{side}"]
        assert np.sign(turned) == np.sign(inward)
        assert abs(turned) == pytest.approx(np.rad2deg(0.4))


def test_the_pelvis_has_the_angles_of_the_ground() -> None:
    """Facing the ground's x, the world's y, tilt is backward and list to the right."""
    pose = BODY.neutral.copy()
    pose[BODY.index("pelvis_rz")] = np.pi / 2.0
    assert read(BODY, pose)["pelvis_rotation"] == pytest.approx(0.0, abs=1e-9)
    pose[BODY.index("pelvis_ry")] = 0.2
    assert read(BODY, pose)["pelvis_tilt"] == pytest.approx(-np.rad2deg(0.2))
    pose[BODY.index("pelvis_ry")], pose[BODY.index("pelvis_rx")] = 0.0, 0.2
    assert read(BODY, pose)["pelvis_list"] == pytest.approx(np.rad2deg(0.2))


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_angles_give_back_the_rotations(name, seed) -> None:
    body = BODIES[name]
    pose = body.neutral + np.random.default_rng(seed).uniform(-1.0, 1.0, body.size)
    angles = read(body, pose)
    nodes, own, axes = transforms(body, pose), segment_nodes(body), segment_axes(body)

    def placed(segment):
        return nodes[own[segment], :, :3] @ axes[segment]

    for side, s in (("r", 1.0), ("l", -1.0)):
        for stem, segment, reference in (
            (("hip_flexion", "hip_adduction", "hip_rotation"), "thigh", "pelvis"),
            (("arm_flex", "arm_add", "arm_rot"), "upper_arm", "thorax"),
        ):
            a, b, c = (angles[f"{name}_{side}"] for name in stem)
            expected = Rotation.from_euler("ZXY", [a, s * b, s * c], degrees=True).as_matrix()
            found = placed(reference).T @ placed(f"{side}_{segment}")
            np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_jacobian_is_finite_differences(name, seed) -> None:
    body = BODIES[name]
    pose = body.neutral + np.random.default_rng(seed).uniform(-0.5, 0.5, body.size)
    reader, step = AngleReader(body), 1e-6
    reader.read(pose)
    jacobian = reader.jacobian(pose)
    for k in range(body.size):
        shift = np.zeros(body.size)
        shift[k] = step
        ends = []
        for s in (-1.0, 1.0):
            reader.reset()
            ends.append(reader.read(pose + s * shift).values_rad)
        np.testing.assert_allclose((ends[1] - ends[0]) / (2.0 * step), jacobian[:, k], atol=1e-6)


def test_deviations_follow_from_the_covariance() -> None:
    pose = posture(BODY, {"l_shoulder_y": 0.6, "r_hip_y": 0.4})
    rng = np.random.default_rng(0)
    root = rng.standard_normal((BODY.size, BODY.size)) * 0.01
    covariance = root @ root.T
    angles = AngleReader(BODY).read(pose, 0, covariance)
    jacobian = AngleReader(BODY).jacobian(pose)
    expected = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T))
    np.testing.assert_allclose(angles.sd_rad, expected, rtol=1e-9)
    assert AngleReader(BODY).read(pose).sd_rad is None
    # Nothing known of the rotation of an arm: its deviation says so, and stays bounded.
    vague = np.diag(np.full(BODY.size, 1e-6))
    vague[BODY.index("r_shoulder_z"), BODY.index("r_shoulder_z")] = 100.0
    sd = AngleReader(BODY).read(pose, 0, vague).sd_degrees()
    assert sd["arm_rot_r"] > 100.0 and sd["elbow_flex_r"] < 1.0


def largest_steps(body, poses):
    """By angle the largest change between successive poses, degrees."""
    reader = AngleReader(body)
    rows = [reader.read(pose, k * STEP_NS).values_rad for k, pose in enumerate(poses)]
    steps = np.rad2deg(np.abs(np.diff(rows, axis=0)).max(axis=0))
    return dict(zip(reader.names, steps, strict=True)), rows


def arm_at(directions, body=BODY, side="r"):
    """Poses whose arm goes the shortest way from each direction (3,) to the next."""
    pose, rotation = body.neutral.copy(), np.eye(3)
    rest = transforms(body, body.neutral)[body.frames[f"{side}_shoulder"], :, :3]
    last = np.array([0.0, 0.0, -1.0])
    for direction in directions:
        new = direction / np.linalg.norm(direction)
        axis = np.cross(last, new)
        angle = np.arctan2(np.linalg.norm(axis), last @ new)
        if angle > 1e-9:
            turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()
            rotation = turn @ rotation
        last = new
        set_rotation(body, pose, f"{side}_shoulder", rest.T @ rotation @ rest)
        yield pose.copy()


def arc(begin, end, count):
    t = np.linspace(0.0, 1.0, count)[:, None]
    angle = np.arccos(np.clip(np.dot(begin, end), -1, 1))
    return (np.sin((1 - t) * angle) * begin + np.sin(t * angle) * end) / np.sin(angle)


DOWN, FORWARD, RIGHT = np.array([0, 0, -1.0]), np.array([1.0, 0, 0]), np.array([0, -1.0, 0])
UP = np.array([0.05, -0.05, 1.0]) / np.linalg.norm([0.05, -0.05, 1.0])
NEARLY_RIGHT = np.array([0.09, -1.0, 0.0]) / np.hypot(1.0, 0.09)


@pytest.mark.parametrize(
    "corners",
    [
        [DOWN, RIGHT, UP],
        [DOWN, NEARLY_RIGHT, UP],
        [DOWN, FORWARD, RIGHT, DOWN],
        [DOWN, RIGHT, FORWARD, DOWN],
        [DOWN, FORWARD, UP, RIGHT, DOWN],
    ],
    ids=["sideways overhead", "beside it", "Codman", "Codman back", "all round"],
)
def test_angles_are_continuous_through_raised_arms(corners) -> None:
    """At 3 degrees a frame no angle of the arm steps by more than 12, through 90 of abduction."""
    path = np.concatenate([arc(a, b, 40) for a, b in zip(corners[:-1], corners[1:], strict=True)])
    steps, _ = largest_steps(BODY, arm_at(path))
    assert max(steps[f"arm_{name}_r"] for name in ("flex", "add", "rot")) < 12.0, steps


def test_a_held_split_comes_back_to_the_poses_own() -> None:
    """At rest away from 90 degrees of abduction the angles are again those of the rotation."""
    path = np.concatenate([arc(DOWN, FORWARD, 40), arc(FORWARD, RIGHT, 40), arc(RIGHT, DOWN, 40)])
    poses = list(arm_at(path))
    poses += [poses[-1]] * 60
    reader = AngleReader(BODY)
    rows = [reader.read(pose, k * STEP_NS).degrees() for k, pose in enumerate(poses)]
    fresh = AngleReader(BODY).read(poses[-1]).degrees()
    for name in ("arm_flex_r", "arm_add_r", "arm_rot_r"):
        off = (rows[-1][name] - fresh[name]) % 360.0
        assert min(off, 360.0 - off) < 1e-6, name
    assert SPLIT_RAD_S < np.deg2rad(12.0) * 60.0


def test_full_turns_of_the_person_are_continuous() -> None:
    turned = []
    for k in range(240):
        pose = posture(BODY, {"l_shoulder_y": 0.4, "r_hip_y": 0.3, "r_knee": 0.4})
        pose[BODY.index("pelvis_rz")] = np.deg2rad(4.0 * k)
        turned.append(pose)
    steps, rows = largest_steps(BODY, turned)
    assert max(steps.values()) < 4.0 + 1e-6
    rotation = np.rad2deg(np.array(rows)[:, AngleReader(BODY).names.index("pelvis_rotation")])
    assert rotation[-1] - rotation[0] == pytest.approx(4.0 * 239)


def test_a_swaying_stander_with_straight_limbs_does_not_jump() -> None:
    rng = np.random.default_rng(5)
    poses = [BODY.neutral + np.deg2rad(1.0) * rng.standard_normal(BODY.size) for _ in range(100)]
    steps, _ = largest_steps(BODY, poses)
    assert max(steps.values()) < 12.0


def test_another_size_of_the_body_goes_on() -> None:
    reader, pose = AngleReader(BODY), BODY.neutral.copy()
    pose[BODY.index("pelvis_rz")] = 3.0
    reader.read(pose)
    pose[BODY.index("pelvis_rz")] = 3.3
    before = reader.read(pose).degrees()["pelvis_rotation"]
    reader.take(load_body("person31", 1.9))
    assert reader.read(pose).degrees()["pelvis_rotation"] == pytest.approx(before)
    reader.reset()
    assert -180.0 <= reader.read(pose).degrees()["pelvis_rotation"] <= 180.0
