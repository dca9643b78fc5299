"""A made-up person before four cameras, and a tracker process that sees them."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import cv2
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from markerless_tracker.body import (
    load_description,
    subject_from_stature,
    write_pose,
    write_subject,
)
from markerless_tracker.camera import write_calibration
from markerless_tracker.camera.ros_fields import optical_frame
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.ros.stamps import stamp_of
from markerless_tracker.synthesis.scene import SyntheticScene

STATURE_M = 1.72
READY_S = 600.0  # the first start compiles


@dataclass(frozen=True)
class World:
    """Files and scene of a made-up person."""

    folder: Path
    scene: SyntheticScene

    def parameters(self) -> dict[str, Any]:
        return {
            "calibration_file": self.folder / "calibration.toml",
            "background_dir": self.folder / "background",
            "subject_file": self.folder / "subject.yaml",
            "start_file": self.folder / "start.yaml",
            "body": "balan31",
        }


@pytest.fixture(scope="session")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    folder = tmp_path_factory.mktemp("world")
    scene = SyntheticScene(
        body="balan31", stature_m=STATURE_M, size_px=(328, 245), fps=30.0, samples=2, motion="stand"
    )
    write_calibration(folder / "calibration.toml", scene.rig)
    (folder / "background").mkdir()
    for name, images in scene.backgrounds(4).items():
        (folder / "background" / name).mkdir()
        for index, image in enumerate(images):
            cv2.imwrite(str(folder / "background" / name / f"{index:06d}.png"), image)
    subject = subject_from_stature(load_description("balan31"), STATURE_M)
    write_subject(folder / "subject.yaml", subject)
    write_pose(folder / "start.yaml", scene.body, scene.pose(0))
    return World(folder, scene)


@lru_cache(maxsize=4)
def pictures(scene: Any, index: int) -> dict[str, Any]:
    """A scene's images of a frame, by camera; rendered once for all cameras."""
    return dict(scene.frame(index)[0])


class Camera:
    """Publishes the images of a scene as cameras would.

    `compressed`: as PNG, on the topics' subtopics; `latched`: late subscribers get camera infos.
    """

    def __init__(
        self,
        node: Node,
        scene: SyntheticScene,
        *,
        reliable: bool = True,
        compressed: bool = False,
        latched: bool = False,
        image_topic: str = "NAME/image_raw",
    ) -> None:
        self.scene = scene
        self.names = scene.rig.names
        self.compressed = compressed
        reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=10, reliability=reliability)
        kind, topic = Image, image_topic
        if compressed:
            kind, topic = CompressedImage, f"{image_topic}/compressed"
        self.images = {
            n: node.create_publisher(kind, topic.replace("NAME", n), qos) for n in self.names
        }
        info_qos = latched_qos() if latched else qos
        self.infos = {
            n: node.create_publisher(CameraInfo, f"{n}/camera_info", info_qos) for n in self.names
        }

    def message(self, name: str, index: int, stamp_ns: int | None = None) -> Any:
        """One camera's image, at another time if wanted."""
        stamp_ns = self.scene.stamp_ns(index) if stamp_ns is None else stamp_ns
        head, picture = header(stamp_ns, optical_frame(name)), pictures(self.scene, index)[name]
        if self.compressed:
            data = cv2.imencode(".png", picture)[1].tobytes()
            return CompressedImage(header=head, format="bgr8; png compressed bgr8", data=data)
        return fill_image(Image(header=head), picture, name)

    def send(self, index: int, *, stamp_ns: int | None = None, **instead: Image | None) -> int:
        """Publish one set, some cameras' messages replaced or left out; returns its stamp."""
        stamp_ns = self.scene.stamp_ns(index) if stamp_ns is None else stamp_ns
        for name in self.names:
            if name not in instead:
                self.images[name].publish(self.message(name, index, stamp_ns))
            elif instead[name] is not None:
                self.images[name].publish(instead[name])
        return stamp_ns

    def send_infos(self) -> None:
        """Publish the camera infos of all cameras."""
        for camera in self.scene.rig:
            self.infos[camera.name].publish(info_of(camera, 0))


class Live:
    """A tracker process, cameras, and everything the tracker publishes."""

    def __init__(
        self, peer: Any, process: Any, world: World, *, reliable: bool = True, **camera: Any
    ) -> None:
        self.peer, self.process, self.world = peer, process, world
        self.camera = Camera(peer.node, world.scene, reliable=reliable, **camera)
        self.states = peer.collect(DiagnosticArray, "state", latched_qos())
        self.diagnostics = peer.collect(DiagnosticArray, "/diagnostics", output_qos())
        self.joints = peer.collect(JointState, "joint_states", output_qos())
        self.roots = peer.collect(PoseWithCovarianceStamped, "root_pose", output_qos())
        self.poses = peer.collect(PoseArray, "marker_poses", output_qos())
        self.markers = peer.collect(MarkerArray, "markers", output_qos())
        self.urdfs = peer.collect(String, "robot_description", latched_qos())
        self.until(lambda: self.value("ready") == "true", "`ready`", READY_S)
        used = [name for name in self.camera.names if f"refused/{name}" in self.values]
        publishers = [self.camera.images[name] for name in used]
        if reliable:
            publishers += [self.camera.infos[name] for name in used]
        self.until(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions")
        self.next = 0

    def until(self, condition: Any, what: str, deadline_s: float = 120.0) -> Any:
        def check() -> Any:
            assert self.process.running, self.process.output
            return condition()

        def missing() -> str:
            return f"{what}; state {self.values}, log {self.process.output}"

        return self.peer.until(check, missing, deadline_s=deadline_s)

    @property
    def values(self) -> dict[str, str]:
        return {p.key: p.value for p in self.states[-1].status[0].values} if self.states else {}

    def value(self, key: str) -> str:
        return self.values.get(key, "")

    @property
    def level(self) -> int:
        return int.from_bytes(self.states[-1].status[0].level, "little")

    @property
    def message(self) -> str:
        return str(self.states[-1].status[0].message)

    def track(self, **instead: Image | None) -> int:
        """Send the next set and wait for its pose; returns its index."""
        index, self.next = self.next, self.next + 1
        self.track_at(index, self.camera.scene.stamp_ns(index), **instead)
        return index

    def track_at(self, index: int, stamp_ns: int, **instead: Image | None) -> None:
        """Send a set with a stamp of its own and wait for its pose."""
        self.camera.send(index, stamp_ns=stamp_ns, **instead)
        for got in (self.joints, self.roots, self.poses):
            self.until(lambda got=got: got and stamp_of(got[-1]) == stamp_ns, f"set {index}")
        self.until(lambda: self.value("stamp_ns") == str(stamp_ns), f"the state of set {index}")

    def send_without_pose(self, **instead: Image | None) -> None:
        self.camera.send(self.next, **instead)
        self.next += 1

    def send_until(self, condition: Any, what: str, **instead: Any) -> None:
        """Send sets one after another until something holds; images may be made per set."""

        def sent() -> bool:
            made = {
                name: make(self.next) if callable(make) else make for name, make in instead.items()
            }
            self.send_without_pose(**made)
            end_s = time.monotonic() + 0.1
            while time.monotonic() < end_s:
                self.peer.executor.spin_once(timeout_sec=0.02)
            return bool(condition())

        self.until(sent, what)

    def points(self) -> np.ndarray:
        """The markers (15, 3) of the last pose."""
        return np.array([(p.position.x, p.position.y, p.position.z) for p in self.poses[-1].poses])


@pytest.fixture(scope="module")
def live(world: World, tmp_path_factory: pytest.TempPathFactory, tools: Any) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("live")
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    peer = tools.Peer(context)
    parameters = {**world.parameters(), "result_file": folder / "out" / "walk"}
    process = tools.Process("tracker", folder / "tracker.log", parameters)
    try:
        yield Live(peer, process, world)
    finally:
        process.stop()
        peer.close()
        context.try_shutdown()


@pytest.fixture
def begin(world: World, other_domain: None, start: Any, peer: Any) -> Callable[..., Live]:
    """Start a tracker of the test's own, with further parameters (None: left out).

    With `threads=0`, the default of the node, it tracks in a process of its own, which takes twice
    as long to start: for tests of what crosses to that process or ends it.
    """

    def begun(
        *, reliable: bool = True, environment: Any = None, camera: Any = None, **parameters: Any
    ) -> Live:
        given = {**world.parameters(), "threads": 1, **parameters}
        given = {name: value for name, value in given.items() if value is not None}
        process = start("tracker", environment=environment, **given)
        return Live(peer, process, world, reliable=reliable, **(camera or {}))

    return begun


class EmptyRoom:
    """A scene that the person has left."""

    def __init__(self, scene: SyntheticScene) -> None:
        self.rig, self.stamp_ns = scene.rig, scene.stamp_ns
        self._rooms = {name: images[0] for name, images in scene.backgrounds(1).items()}

    def frame(self, index: int) -> tuple[dict[str, Any]]:
        return (self._rooms,)


class Refurnished:
    """A scene after a cupboard was put into all views, with or without the person."""

    window = np.s_[60:140, 20:60]
    colour = np.array([40.0, 160.0, 230.0])

    def __init__(self, scene: SyntheticScene, *, empty: bool) -> None:
        self._scene, self._empty = scene, empty
        self.rig, self.stamp_ns = scene.rig, scene.stamp_ns
        self._rooms = {name: images[0] for name, images in scene.backgrounds(1).items()}

    def frame(self, index: int) -> tuple[dict[str, Any]]:
        images, masks, _ = self._scene.frame(index)
        shown = {}
        for name, image in images.items():
            shown[name] = (self._rooms[name] if self._empty else image).copy()
            behind = np.ones(image.shape[:2], dtype=bool) if self._empty else masks[name] == 0
            shown[name][self.window][behind[self.window]] = self.colour
        return (shown,)


@pytest.fixture(scope="session")
def scenes() -> Any:
    """The classes above, for tests."""
    return SimpleNamespace(Camera=Camera, Live=Live, EmptyRoom=EmptyRoom, Refurnished=Refurnished)
