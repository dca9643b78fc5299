import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from visualization_msgs.msg import Marker

from markerless_tracker.body import BodyModel, load_body, markers, root_transform
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.urdf import urdf
from markerless_tracker.geometry import apply, inverse, rotation_from_quaternion
from markerless_tracker.node.health import Health, Level
from markerless_tracker.node.ros import messages
from markerless_tracker.node.ros.stamps import stamp_of, time_message
from markerless_tracker.records import Confidence

STAMP_NS = 12_345_678_901


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("balan31", 1.75)


@pytest.fixture(scope="module")
def pose(body: BodyModel) -> np.ndarray:
    rng = np.random.default_rng(3)
    pose = body.neutral + rng.uniform(-0.3, 0.3, body.size)
    pose[body.root[:3]] += (1.0, -2.0, 0.5)
    return pose


@pytest.mark.parametrize("stamp_ns", [0, 1, 999_999_999, 10**9, STAMP_NS])
def test_stamps_round_trip(stamp_ns: int) -> None:
    header = messages.header(stamp_ns)
    assert header.frame_id == "map"
    assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp_ns
    assert time_message(stamp_ns) == header.stamp


def test_joint_states_and_root_pose_carry_the_whole_pose(body: BodyModel, pose: np.ndarray) -> None:
    angles = AngleReader(body).read(pose)
    state = messages.joint_state(angles, STAMP_NS)
    root = messages.root_pose(body, pose, STAMP_NS)
    assert stamp_of(state) == stamp_of(root) == STAMP_NS and root.header.frame_id == "map"
    assert len(state.name) == len(state.position) == body.size - 6
    given = dict(zip(state.name, state.position, strict=True))
    for name, value in zip(angles.names, angles.values_rad, strict=True):
        assert (name in given) == (not name.startswith("pelvis_"))
        if name in given:
            assert given[name] == value
    # A body at a pose of these joints only, moved by the root pose, is the body.
    rootless = pose.copy()
    rootless[body.root] = 0.0
    T = np.eye(4)
    q, p = root.pose.pose.orientation, root.pose.pose.position
    T[:3, :3] = rotation_from_quaternion((q.w, q.x, q.y, q.z))
    T[:3, 3] = (p.x, p.y, p.z)
    local = apply(inverse(root_transform(body, rootless)), markers(body, rootless))
    np.testing.assert_allclose(apply(T, local), markers(body, pose), atol=1e-12)
    assert set(root.pose.covariance) == {0.0}


def test_joint_names_are_those_of_the_urdf(body: BodyModel, pose: np.ndarray) -> None:
    moving = {
        joint.get("name")
        for joint in ElementTree.fromstring(urdf(body)).iter("joint")
        if joint.get("type") != "fixed" and joint.find("mimic") is None
    }
    assert set(messages.joint_state(AngleReader(body).read(pose), 0).name) == moving


def test_marker_poses_are_the_15_in_order(body: BodyModel, pose: np.ndarray) -> None:
    points = markers(body, pose)
    message = messages.marker_poses(points, STAMP_NS)
    assert message.header.frame_id == "map" and stamp_of(message) == STAMP_NS
    got = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    np.testing.assert_array_equal(got, points)


def test_the_body_for_viewers(body: BodyModel, pose: np.ndarray) -> None:
    points = markers(body, pose)
    message = messages.body_markers(body, pose, points, STAMP_NS)
    cylinders = [m for m in message.markers if m.type == Marker.CYLINDER]
    assert len(cylinders) == len(body.cone_names)
    assert len({(m.ns, m.id) for m in message.markers}) == len(message.markers)
    for marker in message.markers:
        assert marker.header.frame_id == "map" and stamp_of(marker) == STAMP_NS
        q = marker.pose.orientation
        assert np.linalg.norm((q.x, q.y, q.z, q.w)) == pytest.approx(1.0)
        assert min(marker.scale.x, marker.scale.y, marker.scale.z) > 0.0
    # The axis of the left thigh runs from hip to knee.
    thigh = cylinders[body.cone_names.index("l_thigh")]
    p, q = thigh.pose.position, thigh.pose.orientation
    axis = rotation_from_quaternion((q.w, q.x, q.y, q.z))[:, 2]
    hip, knee = points[9], points[10]
    np.testing.assert_allclose((p.x, p.y, p.z), (hip + knee) / 2, atol=0.03)
    assert abs(axis @ (knee - hip)) / np.linalg.norm(knee - hip) > 0.98


def test_a_lost_body_disappears_from_viewers() -> None:
    assert [m.action for m in messages.no_markers(1).markers] == [Marker.DELETEALL]


@pytest.mark.parametrize(
    ("level", "number"),
    [
        (Level.OK, DiagnosticStatus.OK),
        (Level.WARN, DiagnosticStatus.WARN),
        (Level.STALE, DiagnosticStatus.STALE),
    ],
)
def test_state_levels(level: Level, number: bytes) -> None:
    values = {"activity": "tracking", "ready": "true"}
    message = messages.state_message("/left/tracker", values, Health(level, "why"), STAMP_NS)
    (status,) = message.status
    assert (status.level, status.message) == (number, "why")
    assert status.name == "left/tracker: tracking"
    assert {pair.key: pair.value for pair in status.values} == values
    assert stamp_of(message) == STAMP_NS


def test_deviations_and_covariance(body: BodyModel, pose: np.ndarray) -> None:
    covariance = np.arange(36.0).reshape(6, 6)
    sure = Confidence(np.full(body.size, 0.02), np.ones((15, 3)), covariance)
    angles = AngleReader(body).read(pose, STAMP_NS, sure.covariance)
    message = messages.joint_deviations(angles, STAMP_NS)
    assert message.name == messages.joint_state(angles, 0).name
    assert stamp_of(message) == STAMP_NS
    given = dict(zip(message.name, message.position, strict=True))
    assert given["knee_angle_l"] == pytest.approx(0.02)
    assert messages.joint_deviations(AngleReader(body).read(pose), 0).name == []
    root = messages.root_pose(body, pose, STAMP_NS, sure)
    np.testing.assert_array_equal(np.reshape(root.pose.covariance, (6, 6)), covariance)
