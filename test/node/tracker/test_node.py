"""The real node as a process of its own, made-up images over the real middleware."""

import json
import shutil
import signal
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# ruff: noqa: E402
rclpy = pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import cv2
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from markerless_tracker.body import (
    MARKER_NAMES,
    load_description,
    subject_from_stature,
    write_pose,
    write_subject,
)
from markerless_tracker.camera import write_calibration
from markerless_tracker.datasets import read_trc
from markerless_tracker.errors import TrackerError
from markerless_tracker.geometry import rotation_from_quaternion
from markerless_tracker.imaging import read_background_model
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.images import fill_image
from markerless_tracker.node.ros.messages import header, optical_frame
from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos
from markerless_tracker.node.ros.stamps import stamp_of
from markerless_tracker.synthesis.scene import SyntheticScene

TOLERANCE_MEAN_M, TOLERANCE_MAX_M = 0.015, 0.10
"""At 328x245 px a pixel is 13 mm. The model fits itself: this proves the plumbing, no accuracy."""

STATURE_M = 1.72
READY_S = 240.0  # the first start compiles


@dataclass(frozen=True)
class World:
    """A made-up person's files and scene."""

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


@pytest.fixture(scope="module")
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


class Camera:
    """Publishes a scene's images as cameras would."""

    def __init__(self, node: Node, scene: SyntheticScene) -> None:
        self.scene = scene
        self.names = scene.rig.names
        self.images = {n: node.create_publisher(Image, f"{n}/image_raw", 10) for n in self.names}
        self.infos = {
            n: node.create_publisher(CameraInfo, f"{n}/camera_info", 10) for n in self.names
        }

    def send(self, index: int, **instead: Image) -> int:
        """Publish one set, with some cameras' messages replaced; returns its stamp."""
        stamp_ns = self.scene.stamp_ns(index)
        images = self.scene.frame(index)[0]
        for name in self.names:
            message = Image(header=header(stamp_ns, optical_frame(name)))
            self.images[name].publish(instead.get(name) or fill_image(message, images[name], name))
        return stamp_ns


class Live:
    """A tracker process, cameras, and everything the tracker says."""

    def __init__(self, peer: Any, process: Any, world: World) -> None:
        self.peer, self.process, self.world = peer, process, world
        self.camera = Camera(peer.node, world.scene)
        self.states = peer.collect(DiagnosticArray, "state", latched_qos())
        self.joints = peer.collect(JointState, "joint_states", output_qos())
        self.roots = peer.collect(PoseWithCovarianceStamped, "root_pose", output_qos())
        self.poses = peer.collect(PoseArray, "marker_poses", output_qos())
        self.markers = peer.collect(MarkerArray, "markers", output_qos())
        self.urdfs = peer.collect(String, "robot_description", latched_qos())
        self.until(lambda: self.value("ready") == "true", "`ready`", READY_S)
        publishers = [*self.camera.images.values(), *self.camera.infos.values()]
        self.until(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions")
        self._next = 0

    def until(self, condition: Any, what: str, deadline_s: float = 30.0) -> Any:
        def check() -> Any:
            assert self.process.running, self.process.output
            return condition()

        return self.peer.until(check, f"{what}; state {self.values}", deadline_s=deadline_s)

    @property
    def values(self) -> dict[str, str]:
        return {p.key: p.value for p in self.states[-1].status[0].values} if self.states else {}

    def value(self, key: str) -> str:
        return self.values.get(key, "")

    def track(self, **instead: Image) -> int:
        """Send the next set and wait for its pose; returns its index."""
        index, self._next = self._next, self._next + 1
        stamp_ns = self.camera.send(index, **instead)
        for got in (self.joints, self.roots, self.poses):
            self.until(lambda got=got: got and stamp_of(got[-1]) == stamp_ns, f"set {index}")
        self.until(lambda: self.value("stamp_ns") == str(stamp_ns), f"the state of set {index}")
        return index

    def send_without_pose(self, **instead: Image) -> None:
        self.camera.send(self._next, **instead)
        self._next += 1


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


def marker_links(urdf: str, joints: JointState, root: PoseWithCovarianceStamped) -> np.ndarray:
    """The 15 markers (15, 3) as anyone would find them: URDF, joint states and root pose."""
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
        T[:3, :3] = turn((0, 0, 1), y) @ turn((0, 1, 0), p) @ turn((1, 0, 0), r)
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
        T[:3, :3] = turn(axis, value)
    return T


def turn(axis: Any, angle: float) -> np.ndarray:
    return cv2.Rodrigues(np.asarray(axis, dtype=float) * angle)[0]


def bad_image(encoding: str, width: int, height: int, stamp_ns: int = 0) -> Image:
    message = Image(header=header(stamp_ns, "x"), encoding=encoding, width=width, height=height)
    message.step = width * 3
    message.data = bytes(message.step * height)
    return message


def test_joint_states_and_root_pose_give_the_known_joints(live: Live) -> None:
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
    assert values["state"] == "TRACKING" and float(values["fitness"]) > 1.5
    assert all(float(values[f"iou/{name}"]) > 0.8 for name in live.camera.names)
    assert values["skipped"] == "0" and float(values["latency_median_ms"]) > 0.0
    live.until(lambda: live.markers, "markers for viewers")


def test_a_missing_camera_info_is_named_and_does_not_stop_it(live: Live) -> None:
    live.track()
    live.until(lambda: "cam03/camera_info: no camera info" in live.process.output, "the line")
    assert "cam03/camera_info" in live.value("missing")
    assert live.process.output.count("cam03/camera_info") == 1
    for camera in live.world.scene.rig:
        live.camera.infos[camera.name].publish(info_of(camera, 0))
    live.until(lambda: "camera_info" not in live.value("missing"), "nothing to be missing")


@pytest.mark.parametrize(
    ("encoding", "width", "height", "says"),
    [
        ("yuv422", 328, 245, "cam02/image_raw: image encoding 'yuv422' is not known"),
        ("bgr8", 164, 122, "cam02/image_raw: an image of 164x122 px came"),
    ],
)
def test_a_bad_image_costs_its_set_only(
    live: Live, encoding: str, width: int, height: int, says: str
) -> None:
    live.track()
    refused, tracked = int(live.value("refused/cam02")), int(live.value("tracked"))
    live.send_without_pose(cam02=bad_image(encoding, width, height))
    live.until(lambda: int(live.value("refused/cam02")) == refused + 1, "the refusal")
    assert live.value("last_error").startswith(says)
    assert live.process.output.count(says) == 1
    live.track()
    live.until(lambda: int(live.value("tracked")) == tracked + 1, "the next set")
    assert live.value("state") == "TRACKING"


def test_a_camera_info_of_another_size_stops_its_camera_until_it_is_right(live: Live) -> None:
    live.track()
    rig = live.world.scene.rig
    live.camera.infos["cam01"].publish(info_of(rig["cam01"].scaled(0.5), 0))
    live.until(lambda: "cam01/camera_info: says 164x122" in live.value("last_error"), "the error")
    refused = int(live.value("refused/cam01"))
    live.send_without_pose()
    live.until(lambda: int(live.value("refused/cam01")) > refused, "the refusal")
    live.camera.infos["cam01"].publish(info_of(rig["cam01"], 0))

    def tracks_again() -> bool:
        # The topics are apart: images may overtake the camera info.
        count = len(live.joints)
        live.send_without_pose()
        for _ in range(20):
            live.peer.executor.spin_once(timeout_sec=0.05)
        return len(live.joints) > count

    live.until(tracks_again, "poses again")


def test_sets_that_come_too_fast_are_skipped_not_queued(live: Live) -> None:
    live.track()
    before = {key: int(live.value(key)) for key in ("tracked", "skipped")}
    sets = 20
    for _ in range(sets):
        live.send_without_pose()
        # Time for the middleware, but not for the tracker.
        live.peer.executor.spin_once(timeout_sec=0.01)
    newest_ns = live.world.scene.stamp_ns(live._next - 1)
    live.until(lambda: live.value("stamp_ns") == str(newest_ns), "the newest set")
    tracked, skipped = (int(live.value(key)) - before[key] for key in before)
    assert skipped > 0 and 0 < tracked < sets and tracked + skipped <= sets
    lost = sum(int(live.value(f"lost/{name}")) for name in live.camera.names)
    assert tracked + skipped == sets or lost > 0


def test_reset_begins_from_the_start_pose(live: Live) -> None:
    live.track()
    client = live.peer.node.create_client(Trigger, "tracker/reset")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(Trigger.Request())
    live.until(future.done, "the answer")
    assert future.result().success
    live.track()


def test_a_stream_that_begins_anew_is_tracked_again(live: Live) -> None:
    live.track()
    live.track()
    live._next = 0
    for _ in range(3):
        live.track()
    assert int(live.value("restarts")) >= 1 and live.value("state") == "TRACKING"


def test_overlays_are_drawn_while_somebody_looks(live: Live) -> None:
    overlays = live.peer.collect(Image, "debug/cam02/overlay", image_qos())

    def drawn() -> bool:
        live.track()
        return bool(overlays)

    live.until(drawn, "an overlay")
    assert (overlays[-1].width, overlays[-1].height) == (328, 245)
    assert overlays[-1].header.frame_id == "cam02_optical_frame"
    assert stamp_of(overlays[-1]) <= stamp_of(live.joints[-1])


def test_the_evidence_is_drawn_while_somebody_looks(live: Live) -> None:
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
    assert edges.max() > 100


def test_parameters_show_what_is_in_effect(live: Live) -> None:
    from rcl_interfaces.srv import GetParameters

    client = live.peer.node.create_client(GetParameters, "tracker/get_parameters")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(GetParameters.Request(names=["body", "seed", "scale"]))
    live.until(future.done, "the answer")
    body, seed, scale = future.result().values
    assert (body.string_value, seed.integer_value, scale.double_value) == ("balan31", 0, 1.0)


def test_who_leaves_has_no_pose_and_is_tracked_when_he_is_back(live: Live) -> None:
    live.track()
    here = live.camera.scene
    live.camera.scene = EmptyRoom(here)
    try:
        states = []

        def gone() -> bool:
            live.send_without_pose()
            time.sleep(0.1)
            states.append(live.value("state"))
            return states[-1] == "SEARCHING"

        live.until(gone, "the search for somebody")
        assert "LOST" in states
        counts = [len(got) for got in (live.joints, live.roots, live.poses)]
        for _ in range(3):
            gone()
        assert [len(got) for got in (live.joints, live.roots, live.poses)] == counts
    finally:
        live.camera.scene = here
    index = live.track()
    assert live.value("state") == "TRACKING"
    found = np.array([(p.position.x, p.position.y, p.position.z) for p in live.poses[-1].poses])
    assert np.linalg.norm(found - here.markers(index), axis=1).mean() < 0.10


def test_the_background_is_learned_when_nobody_is_there(
    world: World, tmp_path: Path, other_domain: None, start: Any, peer: Any
) -> None:
    folder = tmp_path / "background"
    shutil.copytree(world.folder / "background", folder)
    parameters = {**world.parameters(), "background_dir": folder, "learn_background_sets": 4}
    live = Live(peer, start("tracker", **parameters), world)
    client = peer.node.create_client(Trigger, "tracker/learn_background")
    live.until(client.service_is_ready, "the service")

    def learn(scene: Any) -> Any:
        future = client.call_async(Trigger.Request())
        while not future.done():
            live.camera.scene = scene
            live.send_without_pose()
            end_s = time.monotonic() + 0.3
            live.until(lambda end_s=end_s: future.done() or time.monotonic() > end_s, "a turn")
        return future.result()

    live.track()
    answer = learn(world.scene)
    assert not answer.success and "somebody stands there" in answer.message, answer
    assert not list(folder.glob("*.npz"))

    moved = Refurnished(world.scene, empty=True)
    answer = learn(moved)
    assert answer.success, answer.message
    model = read_background_model(folder / "cam02.npz")
    assert abs(model.mean[moved.window] - moved.colour).max() < 4.0
    live.until(lambda: live.value("state") == "SEARCHING", "a new beginning")

    live.camera.scene = Refurnished(world.scene, empty=False)
    for _ in range(3):
        live.track()
    assert live.value("state") == "TRACKING" and live.value("warnings") == ""
    assert all(float(live.value(f"iou/{name}")) > 0.8 for name in live.camera.names)


def test_a_node_without_background_waits_for_one(
    world: World, tmp_path: Path, other_domain: None, start: Any, peer: Any
) -> None:
    folder = tmp_path / "background"
    parameters = {**world.parameters(), "background_dir": folder, "learn_background_sets": 3}
    live = Live(peer, start("tracker", **parameters, wait_for_background=True), world)
    live.send_without_pose()
    live.until(lambda: live.value("activity") == "waiting for learn_background", "to wait")
    client = peer.node.create_client(Trigger, "tracker/learn_background")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(Trigger.Request())
    live.camera.scene = Refurnished(world.scene, empty=True)
    while not future.done():
        live.send_without_pose()
        end_s = time.monotonic() + 0.3
        live.until(lambda end_s=end_s: future.done() or time.monotonic() > end_s, "a turn")
    assert future.result().success, future.result().message
    assert len(list(folder.glob("*.npz"))) == len(live.camera.names)
    live.camera.scene = Refurnished(world.scene, empty=False)
    live.track()
    assert live.value("state") == "TRACKING" and live.value("dropped_on_error") == "0"


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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_completes_the_result(
    number: int, world: World, tmp_path: Path, other_domain: None, start: Any, peer: Any
) -> None:
    process = start("tracker", **world.parameters(), result_file=tmp_path / "new" / "name.of")
    live = Live(peer, process, world)
    stamps = [world.scene.stamp_ns(live.track()) for _ in range(2)]
    process.signal(number)
    assert process.wait() == 0, process.output
    assert "Traceback" not in process.output
    track = read_trc(tmp_path / "new" / "name.of.trc")
    assert track.names == MARKER_NAMES and track.stamps_ns.tolist() == stamps
    listed = [(p.position.x, p.position.y, p.position.z) for p in live.poses[-1].poses]
    np.testing.assert_allclose(track.positions_m[-1], listed, atol=1e-6)
    summary = json.loads((tmp_path / "new" / "name.of.json").read_text())
    assert [frame["stamp_ns"] for frame in summary["frames"]] == stamps
    assert summary["node"]["tracked"] == "2" and summary["node"]["skipped"] == "0"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sede": 1}, "'sede' is unknown, did you mean 'seed'"),
        ({"scale": 0.0}, "scale: got 0.0"),
        ({"optimizer": "magic"}, "optimizer"),
        ({"calibration_file": "nowhere.toml"}, "nowhere.toml"),
        ({"calibration_file": ""}, "calibration_file: not given"),
        ({"calibration_file": "", "cameras": ["cam01"]}, "tf2_msgs"),
        ({"cameras": ["cam01", "cam09"]}, "cam09"),
        ({"background_dir": ""}, "background_dir: not given"),
        ({"background_dir": "{empty}"}, "background_dir: .*nothing for cam01, cam02"),
        ({"start_file": "nowhere.yaml"}, "nowhere.yaml"),
        ({"result_file": "/proc/nowhere/name"}, "/proc/nowhere"),
    ],
)
def test_what_cannot_work_is_one_line(
    change: dict[str, Any], says: str, world: World, tmp_path: Path, ros_context: Any
) -> None:
    from markerless_tracker.node.tracker.node import TrackerNode

    if "tf2_msgs" in says:
        try:
            import tf2_msgs.msg  # noqa: F401
        except ImportError:
            pass
        else:
            pytest.skip("tf2_msgs is installed here")
    given = {key: str(value) for key, value in world.parameters().items()}
    for key, value in change.items():
        given[key] = value.format(empty=tmp_path) if isinstance(value, str) else value
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    with pytest.raises(TrackerError, match=says) as error:
        TrackerNode(context=ros_context, parameter_overrides=overrides)
    assert "\n" not in str(error.value)


def test_an_unknown_parameter_ends_the_process(world: World, start: Any) -> None:
    process = start("tracker", **world.parameters(), evaluatoins=10)
    assert process.wait() == 1
    (line,) = process.output.splitlines()
    assert line == "tracker: parameter 'evaluatoins' is unknown, did you mean 'evaluations'?"


def test_arguments_outside_ros_args_are_refused(
    start: Any, tmp_path: Path, project_root: Path
) -> None:
    from markerless_tracker.node.ros.process import init_context

    with pytest.raises(TrackerError, match="'seed:=1' is not understood.*--ros-args -p"):
        init_context(["seed:=1"])
    with pytest.raises(TrackerError, match="ROS arguments: "):
        init_context(["--ros-args", "-p", "seed"])
