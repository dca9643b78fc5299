"""Forward kinematics against published formulas, and against NumPy on random trees."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import (
    MARKER_NAMES,
    Subject,
    cone_transforms,
    load_body,
    load_description,
    markers,
    markers_of_many,
    root_transform,
    transforms,
)
from markerless_tracker.body.kinematics import (
    farthest_moved_m,
    moving_nodes,
    node_transforms,
)

_LENGTHS = {
    "torso": 0.579, "head": 0.268, "l_clavicle": 0.241, "r_clavicle": 0.177,
    "l_upper_arm": 0.206, "r_upper_arm": 0.243, "l_forearm": 0.220, "r_forearm": 0.248,
    "l_hip_offset": 0.099, "r_hip_offset": 0.113, "l_thigh": 0.425, "r_thigh": 0.394,
    "l_calf": 0.449, "r_calf": 0.465,
}  # fmt: skip
# Every length differs between the sides, so that swapped sides are seen.
BODY = load_body("balan31", Subject("sample", _LENGTHS))
POSES = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).uniform(-3.1, 3.1, BODY.size)
)


def rx(a):
    c, s = np.cos(a), np.sin(a)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def ry(a):
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def rz(a):
    c, s = np.cos(a), np.sin(a)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def move(x, y, z):
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def e(a, b, c):
    return rz(c) @ rx(a) @ ry(b)


def e_inv(a, b, c):
    return np.linalg.inv(e(a, b, c))


def published_frames(x, d):
    """The frames of Balan, Sigal and Black's body; x[1] is their x1."""
    x = np.concatenate([[np.nan], x])
    pi = np.pi
    p = move(x[4], x[5], x[6]) @ e(x[1], x[2], x[3])
    frames = {"pelvis": p}
    for side, sign, h in (("l", 1, 7), ("r", -1, 11)):
        hip = p @ ry(pi) @ move(0, sign * d[f"{side}_hip_offset"], 0) @ e_inv(*x[h : h + 3])
        frames[f"{side}_hip"] = hip
        frames[f"{side}_knee"] = hip @ move(0, 0, d[f"{side}_thigh"]) @ e_inv(0, x[h + 3], 0)
    thorax = p @ rx(pi) @ e_inv(0, x[27], x[28]) @ move(0, 0, -d["torso"])
    frames["thorax"] = thorax
    for side, sign, c in (("l", -1, 15), ("r", 1, 21)):
        clavicle = (
            thorax
            @ rx(sign * pi / 2)
            @ e_inv(x[c], x[c + 1], 0)
            @ move(0, 0, -d[f"{side}_clavicle"])
        )
        shoulder = clavicle @ rx(-pi / 2) @ rz(pi) @ ry(-pi / 2) @ e_inv(*x[c + 2 : c + 5])
        elbow = shoulder @ move(0, 0, -d[f"{side}_upper_arm"]) @ e_inv(0, x[c + 5], 0)
        frames |= {f"{side}_clavicle": clavicle, f"{side}_shoulder": shoulder}
        frames[f"{side}_elbow"] = elbow
    frames["head"] = thorax @ rx(pi) @ e_inv(*x[29:32])
    return frames


def published_markers(x, d):
    """The 15 markers by their names."""
    f = published_frames(x, d)
    at = {"Pelvis": f["pelvis"], "Neck": f["thorax"], "Head": f["head"] @ move(0, 0, d["head"])}
    for side in "lr":
        prefix = side.upper()
        at[f"{prefix}Shoulder"] = f[f"{side}_shoulder"]
        at[f"{prefix}Elbow"] = f[f"{side}_elbow"]
        at[f"{prefix}Wrist"] = f[f"{side}_elbow"] @ move(0, 0, -d[f"{side}_forearm"])
        at[f"{prefix}Hip"] = f[f"{side}_hip"]
        at[f"{prefix}Knee"] = f[f"{side}_knee"]
        at[f"{prefix}Ankle"] = f[f"{side}_knee"] @ move(0, 0, d[f"{side}_calf"])
    return np.array([at[name][:3, 3] for name in MARKER_NAMES])


@settings(max_examples=50, deadline=None)
@given(POSES)
def test_frames_are_the_published_ones(pose) -> None:
    nodes = transforms(BODY, pose)
    expected = published_frames(pose, _LENGTHS)
    assert set(expected) == set(BODY.frames)
    for name, T in expected.items():
        np.testing.assert_allclose(nodes[BODY.frames[name]], T[:3], atol=1e-12, err_msg=name)


@settings(max_examples=50, deadline=None)
@given(POSES)
def test_markers_are_the_published_ones(pose) -> None:
    np.testing.assert_allclose(markers(BODY, pose), published_markers(pose, _LENGTHS), atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(POSES)
def test_cones_lie_between_their_joints(pose) -> None:
    """Legs and head along their frames' +z, arms along -z, the torso rigid with the pelvis."""
    frames = published_frames(pose, _LENGTHS)
    down = rx(np.pi)
    expected = {"torso": frames["pelvis"], "head": frames["head"]}
    for side in "lr":
        expected[f"{side}_upper_arm"] = frames[f"{side}_shoulder"] @ down
        expected[f"{side}_forearm"] = frames[f"{side}_elbow"] @ down
        expected[f"{side}_thigh"] = frames[f"{side}_hip"]
        expected[f"{side}_calf"] = frames[f"{side}_knee"]
    T = cone_transforms(BODY, pose)
    assert set(expected) == set(BODY.cone_names)
    for i, name in enumerate(BODY.cone_names):
        np.testing.assert_allclose(T[i], expected[name][:3], atol=1e-12, err_msg=name)
        assert BODY.cone_length[i] == _LENGTHS[name]


def test_root_transform_is_the_pelvis() -> None:
    pose = np.linspace(-1, 1, BODY.size)
    T = root_transform(BODY, pose)
    np.testing.assert_allclose(T, published_frames(pose, _LENGTHS)["pelvis"], atol=1e-12)


def test_neutral_stands_upright_with_hanging_arms() -> None:
    at = dict(zip(MARKER_NAMES, markers(BODY, BODY.neutral), strict=True))
    d = _LENGTHS
    np.testing.assert_allclose(at["LHip"], [0, d["l_hip_offset"], 0], atol=1e-12)
    np.testing.assert_allclose(at["RAnkle"], [0, -d["r_hip_offset"], -0.394 - 0.465], atol=1e-12)
    np.testing.assert_allclose(at["Head"], [0, 0, 0.579 + 0.268], atol=1e-12)
    for side, sign in (("L", 1), ("R", -1)):
        assert sign * at[f"{side}Shoulder"][1] > 0.1
        arm = at[f"{side}Wrist"] - at[f"{side}Shoulder"]
        assert np.hypot(*arm[:2]) < 1e-9 and arm[2] < -0.4


def test_signs_of_flexion() -> None:
    """Forward is +x: what the positive direction of each joint does, as start files need it."""
    for name, marker, direction in (
        ("l_hip_y", "LKnee", 1), ("r_hip_y", "RKnee", 1),
        ("l_knee", "LAnkle", 1), ("r_knee", "RAnkle", 1),
        ("l_shoulder_y", "LElbow", -1), ("r_shoulder_y", "RElbow", 1),
        ("l_elbow", "LWrist", -1), ("r_elbow", "RWrist", -1),
        ("thorax_y", "Neck", 1), ("head_y", "Head", -1), ("pelvis_ry", "Neck", 1),
    ):  # fmt: skip
        pose = BODY.neutral.copy()
        pose[BODY.index(name)] += 0.2
        row = MARKER_NAMES.index(marker)
        moved = markers(BODY, pose)[row] - markers(BODY, BODY.neutral)[row]
        assert direction * moved[0] > 0.03, name


def slow_transforms(pose, parent, fixed, kind, sign, parameter):
    """Twin of the compiled kernel: one 4x4 product after the other."""
    out = []
    for n in range(len(parent)):
        T = np.eye(4) if parent[n] < 0 else out[parent[n]]
        T = T @ np.vstack([fixed[n], [0, 0, 0, 1]])
        if kind[n] >= 3:
            step = np.zeros(3)
            step[kind[n] - 3] = sign[n] * pose[parameter[n]]
            T = T @ move(*step)
        elif kind[n] >= 0:
            T = T @ (rx, ry, rz)[kind[n]](sign[n] * pose[parameter[n]])
        out.append(T)
    return np.array(out)[:, :3]


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 6))
def test_any_tree_agrees_with_the_numpy_reference(seed, nodes, parameters) -> None:
    rng = np.random.default_rng(seed)
    parent = np.array([rng.integers(-1, n) for n in range(nodes)])
    kind = rng.integers(-1, 6, nodes)
    parameter = np.where(kind < 0, -1, rng.integers(0, parameters, nodes))
    sign = rng.choice([-1.0, 1.0, 0.5], nodes)
    fixed = np.stack(
        [(e(*rng.uniform(-3, 3, 3)) @ move(*rng.uniform(-1, 1, 3)))[:3] for _ in range(nodes)]
    )
    poses = rng.uniform(-3, 3, (2, parameters))
    out = np.full((2, nodes, 3, 4), np.nan)
    node_transforms(poses, parent, fixed, kind, sign, parameter, out)
    for pose, placed in zip(poses, out, strict=True):
        expected = slow_transforms(pose, parent, fixed, kind, sign, parameter)
        np.testing.assert_allclose(placed, expected, atol=1e-12)


def test_description_and_body_agree_on_names() -> None:
    description = load_description("balan31")
    assert tuple(description.parameters) == BODY.parameter_names
    assert BODY.joint_names == BODY.parameter_names[6:]


@pytest.mark.parametrize("part", ["root", "l_arm", "torso_head"])
def test_moving_nodes_are_those_whose_transforms_change(part) -> None:
    body = load_body("balan31")
    active = body.subspaces[part]
    pose = body.neutral + 0.1
    moved = pose.copy()
    moved[active] += 0.3
    changes = np.abs(transforms(body, moved) - transforms(body, pose)).max(axis=(1, 2)) > 1e-9
    # A joint at a node moves its descendants; the mask must contain all of them.
    assert (moving_nodes(body, active) | ~changes).all()
    assert moving_nodes(body, active).sum() < len(changes) or part == "root"
    assert not moving_nodes(body, np.empty(0, dtype=int)).any()


@pytest.mark.parametrize("part", ["l_arm", "r_leg", "torso"])
def test_the_farthest_marker_is_that_of_all_markers(part) -> None:
    body = load_body("person32", 1.7)
    active = body.subspaces[part]
    rng = np.random.default_rng(5)
    pose = body.neutral + 0.2 * rng.standard_normal(body.size)
    poses = np.tile(pose, (6, 1))
    poses[1:, active] += rng.uniform(-1.5, 1.5, (5, active.size))
    apart = np.linalg.norm(markers_of_many(body, poses) - markers(body, pose), axis=2)
    far = farthest_moved_m(body, pose, poses, active)
    np.testing.assert_allclose(far, apart.max(axis=1), atol=1e-12)
    assert far[0] == 0.0 and far[1:].min() > 0.01
