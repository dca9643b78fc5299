"""The kinematics of the URDF, at the reported angles, are those of the body."""

import dataclasses
import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import MARKER_NAMES, load_body, markers, root_transform, transforms
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.urdf import urdf
from markerless_tracker.errors import BodyModelError

BODY = load_body("balan31", 1.8)
BODIES = {
    name: load_body(name, 1.8) for name in ("person31", "person34", "person35", "humaneva34")
} | {"balan31": BODY}


def rotation(axis, angle):
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def origin(element):
    at = element.find("origin")
    roll, pitch, yaw = map(float, at.get("rpy").split())
    result = np.eye(4)
    result[:3, :3] = (
        rotation((0, 0, 1), yaw) @ rotation((0, 1, 0), pitch) @ rotation((1, 0, 0), roll)
    )
    result[:3, 3] = list(map(float, at.get("xyz").split()))
    return result


def value_of(joint, values):
    mimic = joint.find("mimic")
    if mimic is None:
        return values[joint.get("name")]
    return float(mimic.get("multiplier", "1")) * values[mimic.get("joint")]


def link_transforms(text, values, T_world_root):
    """Forward kinematics of a URDF, as any reader of the format would do it."""
    joints = ElementTree.fromstring(text).findall("joint")
    children = {joint.find("child").get("link") for joint in joints}
    links = {link.get("name") for link in ElementTree.fromstring(text).findall("link")}
    (root,) = links - children
    known = {root: T_world_root}
    while len(known) < len(links):
        for joint in joints:
            parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
            if parent not in known or child in known:
                continue
            move = np.eye(4)
            if joint.get("type") in ("revolute", "continuous"):
                axis = np.array(list(map(float, joint.find("axis").get("xyz").split())))
                assert np.linalg.norm(axis) == pytest.approx(1)
                move[:3, :3] = rotation(axis, value_of(joint, values))
            known[child] = known[parent] @ origin(joint) @ move
    return root, known


@pytest.mark.parametrize("name", BODIES)
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_links_and_markers_agree_with_the_body(name, seed) -> None:
    body = BODIES[name]
    pose = body.neutral + np.random.default_rng(seed).uniform(-1.2, 1.2, body.size)
    angles = AngleReader(body).read(pose)
    values = dict(zip(angles.names, angles.values_rad, strict=True))
    root, links = link_transforms(urdf(body), values, root_transform(body, pose))
    assert root == "pelvis"
    expected = markers(body, pose)
    for marker_name, marker in zip(MARKER_NAMES, expected, strict=True):
        np.testing.assert_allclose(links[marker_name][:3, 3], marker, atol=1e-9)
    nodes = transforms(body, pose)
    for frame, node in body.frames.items():
        np.testing.assert_allclose(links[frame][:3], nodes[node], atol=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_joints_are_the_reported_angles(name) -> None:
    body = BODIES[name]
    robot = ElementTree.fromstring(urdf(body))
    moving = [
        joint
        for joint in robot.findall("joint")
        if joint.get("type") != "fixed" and joint.find("mimic") is None
    ]
    angles = [angle for angle in AngleReader(body).names if not angle.startswith("pelvis_")]
    assert sorted(joint.get("name") for joint in moving) == sorted(angles)
    knee = next(joint for joint in moving if joint.get("name") == "knee_angle_r")
    assert knee.get("type") == "revolute"
    limits = [float(knee.find("limit").get(key)) for key in ("lower", "upper")]
    np.testing.assert_allclose(np.rad2deg(limits), [-5.0, 155.0])
    hip = next(joint for joint in moving if joint.get("name") == "hip_flexion_r")
    assert hip.get("type") == "continuous" and hip.find("limit") is None


def test_cones_are_cylinders_of_their_length() -> None:
    robot = ElementTree.fromstring(urdf(BODY))
    visuals = {visual.get("name"): visual for visual in robot.iter("visual")}
    assert set(visuals) == set(BODY.cone_names)
    for name, length in zip(BODY.cone_names, BODY.cone_length, strict=True):
        cylinder = visuals[name].find("geometry/cylinder")
        assert float(cylinder.get("length")) == pytest.approx(length)
    thigh = origin(visuals["l_thigh"])[:3, 3]
    np.testing.assert_allclose(thigh, [0, 0, BODY.lengths_m["l_thigh"] / 2])


@pytest.mark.parametrize("name", BODIES)
def test_an_independent_reader_finds_it_valid_and_the_markers_in_place(name) -> None:
    yourdfpy = pytest.importorskip("yourdfpy", reason="an independent reader of URDF")
    body = BODIES[name]
    robot = yourdfpy.URDF.load(io.BytesIO(urdf(body).encode()), load_meshes=False)
    assert robot.validate() and not robot.errors
    assert robot.base_link == "pelvis"
    pose = body.neutral + np.random.default_rng(5).uniform(-1.0, 1.0, body.size)
    angles = AngleReader(body).read(pose)
    values = dict(zip(angles.names, angles.values_rad, strict=True))
    assert {name for name in angles.names if not name.startswith("pelvis_")} == set(
        robot.actuated_joint_names
    )
    robot.update_cfg({name: values[name] for name in robot.actuated_joint_names})
    T = root_transform(body, pose)
    for marker_name, marker in zip(MARKER_NAMES, markers(body, pose), strict=True):
        at = T @ robot.get_transform(marker_name)
        np.testing.assert_allclose(at[:3, 3], marker, atol=1e-6)


def renamed(body, old, new):
    frames = {(new if name == old else name): node for name, node in body.frames.items()}
    return dataclasses.replace(body, frames=frames)


def test_parameters_of_other_frames_are_joints_with_their_own_names() -> None:
    body = renamed(BODY, "l_knee", "left_shin")
    pose = np.random.default_rng(1).uniform(-1, 1, body.size)
    angles = AngleReader(body).read(pose)
    assert "knee_angle_l" not in angles.names and "l_knee" in angles.names
    values = dict(zip(angles.names, angles.values_rad, strict=True))
    text = urdf(body)
    _, links = link_transforms(text, values, root_transform(body, pose))
    for name, marker in zip(MARKER_NAMES, markers(body, pose), strict=True):
        np.testing.assert_allclose(links[name][:3, 3], marker, atol=1e-9)
    (knee,) = [
        j for j in ElementTree.fromstring(text).findall("joint") if j.get("name") == "l_knee"
    ]
    assert knee.get("type") == "revolute"
    limits = body.limits.copy()
    limits[:, body.index("l_knee")] = -np.inf, np.inf
    robot = ElementTree.fromstring(urdf(dataclasses.replace(body, limits=limits)))
    (knee,) = [joint for joint in robot.findall("joint") if joint.get("name") == "l_knee"]
    assert knee.get("type") == "continuous" and knee.find("limit") is None


def test_a_parameter_of_two_joints_is_mimicked() -> None:
    parameters = BODY.node_parameter.copy()
    parameters[parameters == BODY.index("r_knee")] = BODY.index("l_knee")
    body = dataclasses.replace(BODY, node_parameter=parameters)
    body = renamed(renamed(body, "l_knee", "left_shin"), "r_knee", "right_shin")
    joints = ElementTree.fromstring(urdf(body)).findall("joint")
    named = [j for j in joints if j.find("mimic") is not None and "knee" in j.get("name")]
    (mimic,) = named
    assert mimic.find("mimic").get("joint") == "l_knee"
    assert mimic.find("child").get("link") == "right_shin"
    assert len({joint.get("name") for joint in joints}) == len(joints)


def test_a_swing_elsewhere_than_in_hips_and_shoulders_is_an_error() -> None:
    with pytest.raises(BodyModelError, match="l_hip_x is part of a swing"):
        urdf(renamed(BODIES["person31"], "l_hip", "left_thigh"))


def test_a_frame_that_does_not_descend_from_the_root_is_an_error() -> None:
    parents = BODY.node_parent.copy()
    parents[BODY.frames["head"] - 2] = -1
    with pytest.raises(BodyModelError, match="is no descendant of the root frame pelvis"):
        urdf(dataclasses.replace(BODY, node_parent=parents))


def test_links_with_the_same_name_are_an_error() -> None:
    with pytest.raises(BodyModelError, match="must be distinct"):
        urdf(renamed(BODY, "l_knee", "LKnee"))
