"""Draw what a tracker published: markers, TF and the URDF at its frames, from a recorded bag.

Record a bag in one terminal, with tf2_msgs installed (part of every ROS installation):

    markerless_tracker record published_bag \
        --topics robot_description,tf,tf_static,markers,marker_poses

and track in others, until the person was found:

    markerless_tracker synthesize made_up --seconds 5 && markerless_tracker convert made_up walk_bag
    ros2 run markerless_tracker tracker --ros-args -p stature:=1.72 \
        -p calibration_file:=walk_bag/calibration.toml -p background_dir:=walk_bag/background
    ros2 run markerless_tracker player --ros-args -p bag:=walk_bag -p lockstep:=true

Then draw the last published set, or that at a time in s:

    python docs/draw_published.py published_bag docs/published.jpg [TIME]
"""

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from markerless_tracker.datasets.bag.stream import McapFiles

Array = NDArray[np.float64]

TOPICS = ("/robot_description", "/tf", "/tf_static", "/markers", "/marker_poses")
WORLD = "map"
PANEL_PX = (520, 860)
PIXELS_PER_M = 400.0
FINER = 2
"""Drawn larger by this factor, then made smaller."""
SEEN_FROM = np.deg2rad([60.0, 12.0])
"""Azimuth and elevation of the direction from which the panels are drawn."""
BODY, JOINT, BONE = (214, 168, 120), (40, 40, 220), (150, 150, 150)
AXES = ((40, 40, 220), (40, 160, 40), (220, 80, 40))
TEXT = (60, 60, 60)


class Published:
    """The messages of one time.

    Attributes:
        stamp_ns: the time.
        cylinders: markers of the body: pose (4, 4), radii (2,) and length.
        joints: (n, 3) points of the markers.
        marker_poses: (15, 3).
        parents: frame -> parent frame, and T: frame -> its pose (4, 4) in the world.
        visuals: URDF: link, origin (4, 4) in it, radius and length of each cylinder.
    """

    def __init__(self, bag: Path, time_s: float | None) -> None:
        store = get_typestore(Stores.ROS2_JAZZY)
        got: dict[str, list[Any]] = {topic: [] for topic in TOPICS}
        for message in McapFiles(sorted(bag.glob("*.mcap"))):
            if message.topic in got:
                got[message.topic].append(store.deserialize_cdr(message.data, message.type))
        missing = [topic for topic, messages in got.items() if not messages]
        if missing:
            raise SystemExit(f"{bag}: holds nothing on {', '.join(missing)}")
        poses = {stamp_of(m.header): m for m in got["/marker_poses"]}
        markers = {stamp_of(m.markers[0].header): m.markers for m in got["/markers"]}
        frames = {stamp_of(m.transforms[0].header): m.transforms for m in got["/tf"]}
        stamps = sorted(set(poses) & set(markers) & set(frames))
        if not stamps:
            raise SystemExit(f"{bag}: no time has markers, marker_poses and tf")
        wanted_ns = stamps[-1] if time_s is None else round(time_s * 1e9)
        self.stamp_ns = min(stamps, key=lambda stamp: abs(stamp - wanted_ns))
        shown = markers[self.stamp_ns]
        self.cylinders = [
            (pose_of(m.pose), 0.5 * np.array([m.scale.x, m.scale.y]), m.scale.z)
            for m in shown
            if m.ns == "body"
        ]
        self.joints = np.array([xyz(p) for m in shown if m.ns == "joints" for p in m.points])
        self.marker_poses = np.array([xyz(p.position) for p in poses[self.stamp_ns].poses])
        static = got["/tf_static"][-1].transforms
        self.parents: dict[str, str] = {}
        local: dict[str, Array] = {}
        for entry in (*static, *frames[self.stamp_ns]):
            self.parents[entry.child_frame_id] = entry.header.frame_id
            moved = entry.transform
            local[entry.child_frame_id] = transform_of(moved.translation, moved.rotation)
        self.T = {name: self._in_world(name, local) for name in local}
        self.visuals = list(cylinders_of(got["/robot_description"][-1].data))

    def _in_world(self, frame: str, local: dict[str, Array]) -> Array:
        T = np.eye(4)
        while frame != WORLD:
            if frame not in local:
                raise SystemExit(f"TF: {frame} is not connected to {WORLD}")
            T, frame = local[frame] @ T, self.parents[frame]
        return T


def stamp_of(header: Any) -> int:
    """Time of a std_msgs/Header, ns."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def xyz(point: Any) -> tuple[float, float, float]:
    """Coordinates of a point or a vector."""
    return point.x, point.y, point.z


def transform_of(position: Any, q: Any) -> Array:
    """The transform (4, 4) of a position and a quaternion."""
    x, y, z, w = q.x, q.y, q.z, q.w
    T = np.eye(4)
    T[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    T[:3, 3] = xyz(position)
    return T


def pose_of(pose: Any) -> Array:
    """The transform (4, 4) of a geometry_msgs/Pose."""
    return transform_of(pose.position, pose.orientation)


def cylinders_of(urdf: str) -> Any:
    """Link, origin (4, 4), radius and length of each cylinder of a URDF."""
    for link in ElementTree.fromstring(urdf).iter("link"):
        for visual in link.iter("visual"):
            cylinder, origin = visual.find("geometry/cylinder"), visual.find("origin")
            if cylinder is None or origin is None:
                continue
            T = np.eye(4)
            T[:3, 3] = [float(value) for value in origin.get("xyz", "0 0 0").split()]
            turns = [float(value) for value in origin.get("rpy", "0 0 0").split()]
            for axis, angle in enumerate(turns):
                turn, (i, j) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
                turn[[i, j], [i, j]] = np.cos(angle)
                turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
                T[:3, :3] = turn @ T[:3, :3]
            radius, length = (float(cylinder.get(name, "0")) for name in ("radius", "length"))
            yield link.get("name"), T, radius, length


class Panel:
    """A parallel projection of the world about a centre (3,), with a title."""

    def __init__(self, title: str, centre: Array) -> None:
        azimuth, elevation = SEEN_FROM
        ahead = -np.array(
            [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation),
             np.sin(elevation)]
        )  # fmt: skip
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        self._view = np.array([right, np.cross(ahead, right), ahead])
        self._centre = centre
        width, height = (FINER * size for size in PANEL_PX)
        self.image = np.full((height, width, 3), 255, np.uint8)
        for place in np.arange(-1.0, 1.01, 0.25):
            for ends in (((place, -1.0), (place, 1.0)), ((-1.0, place), (1.0, place))):
                floor = np.array([(*end, 0.0) for end in ends]) + (*np.round(centre[:2], 1), 0.0)
                self.line(floor, (225, 225, 225), 1)
        self.text(title, (20, 40), 0.8)

    def pixels(self, points: Array) -> NDArray[np.int32]:
        """Pixels (n, 2) of world points (n, 3)."""
        seen = (points - self._centre) @ self._view.T
        height, width = self.image.shape[:2]
        scale = FINER * PIXELS_PER_M
        return np.round(np.array([0.5 * width, 0.5 * height]) + scale * seen[:, :2]).astype(int)

    def depth(self, point: Array) -> float:
        """Distance of a world point (3,) behind the centre, m."""
        return float((point - self._centre) @ self._view[2])

    def line(self, points: Array, colour: tuple[int, ...], width: int) -> None:
        """A line through world points (n, 3)."""
        shown = [self.pixels(points).astype(np.int32)]
        cv2.polylines(self.image, shown, False, colour, FINER * width, cv2.LINE_AA)

    def dot(self, point: Array, colour: tuple[int, ...], radius: int) -> None:
        """A disc at a world point (3,)."""
        u, v = (int(value) for value in self.pixels(point[None])[0])
        cv2.circle(self.image, (u, v), FINER * radius, colour, -1, cv2.LINE_AA)

    def text(self, words: str, place: tuple[int, int], size: float) -> None:
        """Words at a pixel of the panel."""
        at = (FINER * place[0], FINER * place[1])
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(self.image, words, at, font, FINER * size, TEXT, FINER, cv2.LINE_AA)

    def cylinders(self, cylinders: list[tuple[Array, Array, float]]) -> None:
        """Cylinders as pose (4, 4), radii (2,) and length, the farthest first."""
        around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        for T, radii, length in sorted(cylinders, key=lambda one: -self.depth(one[0][:3, 3])):
            ring = np.column_stack([radii[0] * np.cos(around), radii[1] * np.sin(around)])
            ends = [np.column_stack([ring, np.full(24, at)]) for at in (-length / 2, length / 2)]
            outline = np.concatenate(ends) @ T[:3, :3].T + T[:3, 3]
            hull = cv2.convexHull(self.pixels(outline).astype(np.int32))
            cv2.fillPoly(self.image, [hull], BODY, cv2.LINE_AA)
            cv2.polylines(self.image, [hull], True, (110, 80, 50), FINER, cv2.LINE_AA)


def drawn(published: Published) -> NDArray[np.uint8]:
    """Three panels side by side: markers, frames, URDF."""
    centre = np.array([*published.marker_poses[:, :2].mean(axis=0), 0.9])
    left = Panel("/markers, /marker_poses", centre)
    left.cylinders(published.cylinders)
    for point in published.joints:
        left.dot(point, JOINT, 6)
    for point in published.marker_poses:
        left.dot(point, (255, 255, 255), 2)
    body = [name for name in published.T if not name.endswith("_optical_frame")]
    middle = Panel(f"/tf, /tf_static: {len(body)} frames", centre)
    for name in body:
        parent = published.parents[name]
        if parent != WORLD:
            ends = np.array([published.T[parent][:3, 3], published.T[name][:3, 3]])
            middle.line(ends, BONE, 2)
    for name in body:
        T = published.T[name]
        for axis, colour in enumerate(AXES):
            middle.line(np.array([T[:3, 3], T[:3, 3] + 0.07 * T[:3, axis]]), colour, 2)
    right = Panel("/robot_description at its frames", centre)
    right.cylinders(
        [(published.T[link] @ T, np.array([radius, radius]), length)
         for link, T, radius, length in published.visuals]
    )  # fmt: skip
    whole = np.hstack([left.image, middle.image, right.image])
    size = (whole.shape[1] // FINER, whole.shape[0] // FINER)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8)


def main() -> int:
    """Draw the bag that the arguments name."""
    if not 3 <= len(sys.argv) <= 4:
        print(__doc__, file=sys.stderr)
        return 2
    time_s = float(sys.argv[3]) if len(sys.argv) == 4 else None
    published = Published(Path(sys.argv[1]), time_s)
    if not cv2.imwrite(sys.argv[2], drawn(published)):
        print(f"{sys.argv[2]}: cannot be written", file=sys.stderr)
        return 1
    print(f"{sys.argv[2]}: the set at {published.stamp_ns / 1e9:.3f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
