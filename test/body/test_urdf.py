"""The kinematics of the URDF are those of the body."""

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import MARKER_NAMES, load_body, markers, root_transform, transforms
from markerless_tracker.body.urdf import urdf
from markerless_tracker.errors import BodyModelError

BODY = load_body("balan31", 1.8)


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
                move[:3, :3] = rotation(axis, values[joint.get("name")])
            known[child] = known[parent] @ origin(joint) @ move
    return root, known


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_links_and_markers_agree_with_the_body(seed) -> None:
    pose = np.random.default_rng(seed).uniform(-3, 3, BODY.size)
    values = dict(zip(BODY.parameter_names, pose, strict=True))
    root, links = link_transforms(urdf(BODY), values, root_transform(BODY, pose))
    assert root == "pelvis"
    expected = markers(BODY, pose)
    for name, marker in zip(MARKER_NAMES, expected, strict=True):
        np.testing.assert_allclose(links[name][:3, 3], marker, atol=1e-9)
    nodes = transforms(BODY, pose)
    for frame, node in BODY.frames.items():
        np.testing.assert_allclose(links[frame][:3], nodes[node], atol=1e-9)


def test_joints_have_names_and_limits() -> None:
    robot = ElementTree.fromstring(urdf(BODY))
    moving = [joint for joint in robot.findall("joint") if joint.get("type") != "fixed"]
    assert sorted(joint.get("name") for joint in moving) == sorted(BODY.joint_names)
    for joint in moving:
        assert joint.get("type") == "revolute"
        limit = joint.find("limit")
        expected = BODY.limits[:, BODY.index(joint.get("name"))]
        np.testing.assert_allclose([float(limit.get("lower")), float(limit.get("upper"))], expected)


def test_cones_are_cylinders_of_their_length() -> None:
    robot = ElementTree.fromstring(urdf(BODY))
    visuals = {visual.get("name"): visual for visual in robot.iter("visual")}
    assert set(visuals) == set(BODY.cone_names)
    for name, length in zip(BODY.cone_names, BODY.cone_length, strict=True):
        cylinder = visuals[name].find("geometry/cylinder")
        assert float(cylinder.get("length")) == pytest.approx(length)
    thigh = origin(visuals["l_thigh"])[:3, 3]
    np.testing.assert_allclose(thigh, [0, 0, BODY.lengths_m["l_thigh"] / 2])


def test_a_free_joint_is_continuous() -> None:
    limits = BODY.limits.copy()
    limits[:, BODY.index("l_knee")] = -np.inf, np.inf
    robot = ElementTree.fromstring(urdf(dataclasses.replace(BODY, limits=limits)))
    (knee,) = [joint for joint in robot.findall("joint") if joint.get("name") == "l_knee"]
    assert knee.get("type") == "continuous" and knee.find("limit") is None


def test_a_parameter_of_two_joints_is_mimicked() -> None:
    parameters = BODY.node_parameter.copy()
    parameters[parameters == BODY.index("r_knee")] = BODY.index("l_knee")
    body = dataclasses.replace(BODY, node_parameter=parameters)
    joints = ElementTree.fromstring(urdf(body)).findall("joint")
    (mimic,) = [joint for joint in joints if joint.find("mimic") is not None]
    assert mimic.find("mimic").get("joint") == "l_knee"
    assert mimic.find("child").get("link") == "r_knee"
    assert len({joint.get("name") for joint in joints}) == len(joints)


def test_a_frame_that_does_not_descend_from_the_root_is_an_error() -> None:
    parents = BODY.node_parent.copy()
    parents[BODY.frames["head"] - 2] = -1
    with pytest.raises(BodyModelError, match="is no descendant of the root frame pelvis"):
        urdf(dataclasses.replace(BODY, node_parent=parents))


def test_links_with_the_same_name_are_an_error() -> None:
    frames = {("LKnee" if name == "l_knee" else name): node for name, node in BODY.frames.items()}
    with pytest.raises(BodyModelError, match="must be distinct"):
        urdf(dataclasses.replace(BODY, frames=frames))
