"""What the node publishes, over the real middleware."""

import time
import xml.etree.ElementTree as ElementTree
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import Image, JointState
from std_srvs.srv import Trigger

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.geometry import rotation_from_quaternion
from markerless_tracker.node.ros.qos import image_qos
from markerless_tracker.node.ros.stamps import stamp_of

TOLERANCE_MEAN_M, TOLERANCE_MAX_M = 0.015, 0.10
"""At 328x245 px a pixel is 13 mm. The model fits itself: this proves the plumbing, no accuracy."""


def marker_links(urdf: str, joints: JointState, root: PoseWithCovarianceStamped) -> np.ndarray:
    """The 15 markers (15, 3) from URDF, joint states and root pose."""
    robot = ElementTree.fromstring(urdf)
    values = dict(zip(joints.name, joints.position, strict=True))
    q, p = root.pose.pose.orientation, root.pose.pose.position
    T_root = np.eye(4)
    T_root[:3, :3] = rotation_from_quaternion((q.w, q.x, q.y, q.z))
    T_root[:3, 3] = (p.x, p.y, p.z)
    pending = list(robot.iter("joint"))
    children = {joint.find("child").get("link") for joint in pending}
    (base,) = {link.get("name") for link in robot.iter("link")} - children
    frames = {base: T_root}
    while pending:
        known = [j for j in pending if j.find("parent").get("link") in frames]
        assert known, "the URDF is no tree"
        for joint in known:
            pending.remove(joint)
            T = frames[joint.find("parent").get("link")] @ origin_of(joint)
            frames[joint.find("child").get("link")] = T @ motion_of(joint, values)
    return np.array([frames[name][:3, 3] for name in MARKER_NAMES])


def origin_of(joint: ElementTree.Element) -> np.ndarray:
    T = np.eye(4)
    origin = joint.find("origin")
    if origin is not None:
        T[:3, 3] = [float(v) for v in origin.get("xyz", "0 0 0").split()]
        r, p, y = (float(v) for v in origin.get("rpy", "0 0 0").split())
        T[:3, :3] = rotation((0, 0, 1), y) @ rotation((0, 1, 0), p) @ rotation((1, 0, 0), r)
    return T


def motion_of(joint: ElementTree.Element, values: dict[str, float]) -> np.ndarray:
    T = np.eye(4)
    if joint.get("type") == "fixed":
        return T
    mimic = joint.find("mimic")
    name = joint.get("name") if mimic is None else mimic.get("joint")
    value = values[str(name)]
    if mimic is not None:
        value = value * float(mimic.get("multiplier", 1)) + float(mimic.get("offset", 0))
    axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
    if joint.get("type") == "prismatic":
        T[:3, 3] = axis * value
    else:
        T[:3, :3] = rotation(axis, value)
    return T


def rotation(axis: Any, angle: float) -> np.ndarray:
    return cv2.Rodrigues(np.asarray(axis, dtype=float) * angle)[0]


def test_joint_states_and_root_pose_give_the_known_joints(live: Any) -> None:
    worst, means = 0.0, []
    for _ in range(6):
        index = live.track()
        truth = live.world.scene.markers(index)
        found = marker_links(live.urdfs[-1].data, live.joints[-1], live.roots[-1])
        errors = np.linalg.norm(found - truth, axis=1)
        means.append(errors.mean())
        worst = max(worst, errors.max())
        listed = [(p.position.x, p.position.y, p.position.z) for p in live.poses[-1].poses]
        np.testing.assert_allclose(found, listed, atol=1e-6)
        assert live.joints[-1].header.stamp == live.states[-1].header.stamp
    assert np.mean(means) < TOLERANCE_MEAN_M and worst < TOLERANCE_MAX_M, (means, worst)
    values = live.values
    assert values["state"] == "TRACKING" and float(values["fitness"]) > 0.9
    assert all(float(values[f"iou/{name}"]) > 0.8 for name in live.camera.names)
    assert values["skipped"] == "0" and float(values["latency_median_ms"]) > 0.0
    live.until(lambda: live.markers, "markers for viewers")


def test_reset_begins_from_the_start_pose(live: Any) -> None:
    live.track()
    client = live.peer.node.create_client(Trigger, "tracker/reset")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(Trigger.Request())
    live.until(future.done, "the answer")
    assert future.result().success
    live.track()


def test_overlays_are_drawn_while_subscribed(live: Any) -> None:
    overlays = live.peer.collect(Image, "debug/cam02/overlay", image_qos())

    def drawn() -> bool:
        live.track()
        return bool(overlays)

    live.until(drawn, "an overlay")
    assert (overlays[-1].width, overlays[-1].height) == (328, 245)
    assert overlays[-1].header.frame_id == "cam02_optical_frame"
    assert stamp_of(overlays[-1]) <= stamp_of(live.joints[-1])


def test_the_evidence_is_drawn_while_subscribed(live: Any) -> None:
    strips = live.peer.collect(Image, "debug/cam03/evidence", image_qos())

    def drawn() -> bool:
        live.track()
        return bool(strips)

    live.until(drawn, "the evidence")
    assert (strips[-1].width, strips[-1].height) == (6 * 328, 245)
    assert strips[-1].header.frame_id == "cam03_optical_frame"
    panels = np.frombuffer(strips[-1].data, np.uint8).reshape(245, 6, 328, 3)
    image, background, labels, mask, edges, _ = panels.transpose(1, 0, 2, 3).astype(int)
    person = mask[:, :, 0] == 255
    assert 500 < person.sum() < person.size / 4
    assert (labels[:, :, 0][person] == 255).mean() > 0.8
    difference = abs(image - background).max(axis=2)
    assert np.median(difference[person]) > 20 > np.median(difference[mask[:, :, 0] == 0])
    # At weight 0 no edge map is made; outside the region that was segmented there is dark grey.
    assert set(np.unique(edges)) <= {0, 64}


def test_parameters_show_what_is_in_effect(live: Any) -> None:
    from rcl_interfaces.srv import GetParameters

    client = live.peer.node.create_client(GetParameters, "tracker/get_parameters")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(GetParameters.Request(names=["body", "seed", "scale"]))
    live.until(future.done, "the answer")
    body, seed, scale = future.result().values
    assert (body.string_value, seed.integer_value, scale.double_value) == ("balan31", 0, 1.0)


def test_without_tf2_msgs_the_node_says_so_once(live: Any) -> None:
    said = live.process.output.count("tf2_msgs is not installed: no TF is published")
    assert said == int(not live.peer.node.count_publishers("/tf"))


def test_a_person_who_left_has_no_pose_and_is_tracked_again_later(live: Any, scenes: Any) -> None:
    live.track()
    here = live.camera.scene
    live.camera.scene = scenes.EmptyRoom(here)
    try:
        states = []

        def gone() -> bool:
            live.send_without_pose()
            time.sleep(0.1)
            states.append(live.value("state"))
            return states[-1] == "SEARCHING"

        live.until(gone, "SEARCHING")
        assert "LOST" in states
        counts = [len(got) for got in (live.joints, live.roots, live.poses)]
        for _ in range(3):
            gone()
        assert [len(got) for got in (live.joints, live.roots, live.poses)] == counts
    finally:
        live.camera.scene = here

    def back() -> bool:
        # The first poses of a start may be poor.
        index = live.track()
        found = np.array([(p.position.x, p.position.y, p.position.z) for p in live.poses[-1].poses])
        return bool(np.linalg.norm(found - here.markers(index), axis=1).mean() < 0.10)

    live.until(back, "the person")
    assert live.value("state") == "TRACKING"
