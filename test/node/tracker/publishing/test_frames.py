"""TF of a running tracker, over the real middleware."""

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.geometry import (
    inverse,
    quaternion_from_rotation,
    rotation_from_quaternion,
    transform,
)
from markerless_tracker.node.ros.qos import image_qos, latched_qos
from markerless_tracker.node.ros.ros4hri import JOINTS
from markerless_tracker.node.ros.stamps import stamp_of
from markerless_tracker.node.ros.transforms import TransformMessages


@pytest.fixture(scope="module")
def seen(
    world: Any, tf2_msgs: dict[str, str], tmp_path_factory: Any, tools: Any, scenes: Any
) -> Iterator[Any]:
    """A tracker in an environment with tf2_msgs, and its transforms."""
    from tf2_msgs.msg import TFMessage

    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    peer = tools.Peer(context)
    log = tmp_path_factory.mktemp("frames") / "tracker.log"
    named = {"frame_prefix": "one/", "human_id": "p1", "threads": 1}
    process = tools.Process("tracker", log, {**world.parameters(), **named}, tf2_msgs)
    try:
        live = scenes.Live(peer, process, world)
        live.frames = peer.collect(TFMessage, "/tf", image_qos(depth=100))
        live.statics = peer.collect(TFMessage, "/tf_static", latched_qos())
        yield live
    finally:
        process.stop()
        peer.close()
        context.try_shutdown()


def tree(*messages: Any) -> dict[str, tuple[str, np.ndarray]]:
    """Child -> parent and transform to it."""
    found = {}
    for stamped in (entry for message in messages for entry in message.transforms):
        q, t = stamped.transform.rotation, stamped.transform.translation
        T = transform(rotation_from_quaternion((q.w, q.x, q.y, q.z)), (t.x, t.y, t.z))
        found[stamped.child_frame_id] = (stamped.header.frame_id, T)
    return found


def in_map(frames: dict[str, tuple[str, np.ndarray]], name: str) -> np.ndarray:
    T = np.eye(4)
    while name != "map":
        name, step = frames[name]
        T = step @ T
    return T


def test_all_links_and_cameras_hang_on_map(seen: Any) -> None:
    seen.until(lambda: seen.statics and len(seen.statics[-1].transforms) > 4, "the static frames")
    index = seen.track()
    stamp_ns = seen.camera.scene.stamp_ns(index)
    seen.until(
        lambda: seen.frames and stamp_of(seen.frames[-1].transforms[0]) == stamp_ns, "the frames"
    )
    moving = seen.frames[-1]
    assert all(stamp_of(stamped) == stamp_ns for stamped in moving.transforms)
    frames = tree(seen.statics[-1], moving)
    assert moving.transforms[0].child_frame_id == "one/pelvis"
    for name, point in zip(MARKER_NAMES, seen.points(), strict=True):
        np.testing.assert_allclose(in_map(frames, f"one/{name}")[:3, 3], point, atol=1e-6)
    p, root = seen.roots[-1].pose.pose.position, in_map(frames, "one/pelvis")
    np.testing.assert_allclose(root[:3, 3], [p.x, p.y, p.z], atol=1e-9)
    for camera in seen.camera.scene.rig:
        placed = in_map(frames, f"{camera.name}_optical_frame")
        np.testing.assert_allclose(placed, inverse(camera.T_cam_world), atol=1e-9)


def test_the_person_is_published_under_the_names_of_rep_155(seen: Any) -> None:
    states = seen.peer.collect(JointState, "/humans/bodies/p1/joint_states", image_qos())
    urdfs = seen.peer.collect(String, "/humans/bodies/p1/urdf", latched_qos())
    seen.until(lambda: urdfs, "the URDF")
    index = seen.track()
    seen.until(lambda: states, "the joints")
    stamp_ns = seen.camera.scene.stamp_ns(index)
    assert stamp_of(states[-1]) == stamp_ns
    assert states[-1].name == [f"{name}_p1" for name in JOINTS]
    robot = ElementTree.fromstring(urdfs[-1].data)
    moving = [j.get("name") for j in robot.findall("joint") if j.get("type") == "revolute"]
    assert sorted(moving) == sorted(states[-1].name)
    frames = tree(seen.statics[-1], seen.frames[-1])
    np.testing.assert_allclose(in_map(frames, "body_p1"), in_map(frames, "one/pelvis"))


def test_extrinsics_come_from_the_transforms_of_another_node(
    begin: Callable[..., Any], peer: Any, world: Any, scenes: Any, tf2_msgs: dict[str, str]
) -> None:
    from tf2_msgs.msg import TFMessage

    rig = world.scene.rig
    poses = [inverse(camera.T_cam_world) for camera in rig]
    frames = TransformMessages([("map", f"{name}_optical_frame") for name in rig.names])
    turned = np.array([quaternion_from_rotation(pose[:3, :3]) for pose in poses])
    static = peer.node.create_publisher(TFMessage, "/tf_static", latched_qos())
    static.publish(frames.serialised(0, np.array([pose[:3, 3] for pose in poses]), turned))
    camera = scenes.Camera(peer.node, world.scene)
    peer.node.create_timer(0.2, camera.send_infos)
    seen = begin(
        environment=tf2_msgs, calibration_file=None, cameras=f"[{', '.join(rig.names)}]", tf="root"
    )
    moving = peer.collect(TFMessage, "/tf", image_qos(depth=100))
    seen.until(lambda: peer.node.count_publishers("/tf"), "the topic /tf")
    seen.track()
    seen.until(lambda: moving, "the frame of the root")
    assert [stamped.child_frame_id for stamped in moving[-1].transforms] == ["pelvis"]
    assert peer.node.count_publishers("/tf_static") == 2
    assert float(seen.value("fitness")) > 0.9


def shown_by_rviz(root: Path) -> dict[str, str]:
    """Topic -> type of every display, and the fixed frame."""
    kinds = {
        "RobotModel": "std_msgs/msg/String",
        "MarkerArray": "visualization_msgs/msg/MarkerArray",
        "PoseArray": "geometry_msgs/msg/PoseArray",
        "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "Image": "sensor_msgs/msg/Image",
    }
    manager = yaml.safe_load((root / "config" / "tracker.rviz").read_text())[
        "Visualization Manager"
    ]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    topics = {}
    for display in manager["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        topic = display.get("Description Topic", display.get("Topic"))
        assert (topic is not None) == (kind in kinds), kind
        if topic is not None:
            topics[topic["Value"]] = kinds[kind]
    return topics


def shown_by_foxglove(root: Path) -> dict[str, str | None]:
    """Topics of every panel; None where the panel takes several types."""
    layout = json.loads((root / "config" / "foxglove.json").read_text())
    panels, used, todo = layout["configById"], set(), [layout["layout"]]
    while todo:
        part = todo.pop()
        if isinstance(part, str):
            used.add(part)
        else:
            todo += [part["first"], part["second"]]
    assert used == set(panels)
    topics: dict[str, str | None] = dict.fromkeys(panels["3D!body"]["topics"])
    layers = panels["3D!body"]["layers"].values()
    topics |= {layer["topic"]: "std_msgs/msg/String" for layer in layers if "topic" in layer}
    topics[panels["Image!overlay"]["imageMode"]["imageTopic"]] = "sensor_msgs/msg/Image"
    state = panels["DiagnosticStatusPanel!state"]
    assert state["selectedName"] == "tracker: tracking"
    topics[state["topicToRender"]] = "diagnostic_msgs/msg/DiagnosticArray"
    for path in panels["Plot!pelvis"]["paths"]:
        topic, *fields = path["value"].split(".")
        message: Any = PoseWithCovarianceStamped()
        for field in fields:
            message = getattr(message, field)
        assert topic == "/root_pose" and isinstance(message, float)
    return topics


@pytest.mark.parametrize("shown", [shown_by_rviz, shown_by_foxglove])
def test_viewers_are_set_to_topics_that_exist(seen: Any, shown: Any, project_root: Path) -> None:
    seen.track()
    expected = shown(project_root)
    assert "/robot_description" in expected and len(expected) >= 5
    offered = dict(seen.peer.node.get_topic_names_and_types())
    for topic, kind in expected.items():
        assert seen.peer.node.count_publishers(topic) == 1, topic
        assert kind is None or offered[topic] == [kind]
