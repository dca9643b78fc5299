"""Publishes the frames of the body and of the cameras on /tf and /tf_static."""

from collections.abc import Callable
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.ros_fields import WORLD_FRAME, optical_frame
from markerless_tracker.geometry import FloatArray, inverse, quaternion_from_rotation
from markerless_tracker.node.ros.qos import latched_qos, output_qos
from markerless_tracker.node.ros.transforms import TransformMessages, installed
from markerless_tracker.node.ros.urdf_joints import UrdfJoints, read_joints


class FramePublisher:
    """Publishes transforms, if tf2_msgs is installed.

    On /tf ``map`` -> root link, and with "links" the moving joints of the body's URDF; on
    /tf_static the fixed joints and the cameras' optical frames.

    Args:
        node: creates the publishers.
        choice: one of `TF_CHOICES`; "links": every link, so that viewers need no
            robot_state_publisher; "root": the root link, for use with it; "none": no body.
        cameras: whether the cameras' frames are published.
        prefix: of the links' frames, such as ``person1/``.
        human: id of the person, whose frame ``body_<id>`` is the root link (REP-155); may be empty.
        inform: called with one line if nothing can be published.
    """

    def __init__(
        self,
        node: Any,
        choice: str,
        *,
        cameras: bool,
        prefix: str,
        human: str,
        inform: Callable[[str], None],
    ) -> None:
        self._human = human
        self._choice, self._with_cameras, self._prefix = choice, cameras, prefix
        self._camera_frames: list[tuple[str, str]] = []
        self._camera_numbers = (np.empty((0, 3)), np.empty((0, 4)))
        self._root = ""
        self._moving: UrdfJoints | None = None
        self._fixed: UrdfJoints | None = None
        self._messages: TransformMessages | None = None
        self._publisher: Any = None
        self._static: Any = None
        if choice == "none" and not cameras:
            return
        if not installed():
            inform("tf2_msgs is not installed: no TF is published")
            return
        from tf2_msgs.msg import TFMessage

        self._static = node.create_publisher(TFMessage, "/tf_static", latched_qos())
        if choice != "none":
            self._publisher = node.create_publisher(TFMessage, "/tf", output_qos())

    def cameras(self, rig: CameraRig) -> None:
        """Publish the optical frames of the cameras."""
        if self._static is None or not self._with_cameras:
            return
        poses = [inverse(camera.T_cam_world) for camera in rig]
        self._camera_frames = [(WORLD_FRAME, optical_frame(camera.name)) for camera in rig]
        self._camera_numbers = (
            np.array([pose[:3, 3] for pose in poses]),
            np.array([quaternion_from_rotation(pose[:3, :3]) for pose in poses]),
        )
        self._publish_static()

    def describe(self, urdf: str, root: str) -> None:
        """Take a body: its URDF (text) and the name of its root link."""
        if self._publisher is None:
            return
        self._root = f"{self._prefix}{root}"
        frames = [(WORLD_FRAME, self._root)]
        if self._choice == "links":
            self._moving, self._fixed = read_joints(urdf)
            frames += self._prefixed(self._moving)
        self._publish_static()
        self._messages = TransformMessages(frames)

    def publish(self, T_world_root: FloatArray, values: dict[str, float], stamp_ns: int) -> None:
        """Publish a pose, if there are subscribers.

        Args:
            T_world_root: (4, 4), takes points of the root link to the world.
            values: joint angles by name, rad.
            stamp_ns: time of the images.
        """
        if self._messages is None or not self._publisher.get_subscription_count():
            return
        translations = T_world_root[None, :3, 3]
        quaternions = np.array([quaternion_from_rotation(T_world_root[:3, :3])])
        if self._moving is not None:
            moved, turned = self._moving.transforms(values)
            translations = np.vstack([translations, moved])
            quaternions = np.vstack([quaternions, turned])
        self._publisher.publish(self._messages.serialised(stamp_ns, translations, quaternions))

    def _prefixed(self, joints: UrdfJoints) -> list[tuple[str, str]]:
        return [(f"{self._prefix}{a}", f"{self._prefix}{b}") for a, b in joints.links]

    def _publish_static(self) -> None:
        """Publish all static frames in one message: late subscribers receive only the last one."""
        frames = list(self._camera_frames)
        translations, quaternions = self._camera_numbers
        if self._fixed is not None:
            frames += self._prefixed(self._fixed)
            fixed = self._fixed.transforms({})
            translations = np.vstack([translations, fixed[0]])
            quaternions = np.vstack([quaternions, fixed[1]])
        if self._root and self._human:
            frames.append((self._root, f"body_{self._human}"))
            translations = np.vstack([translations, np.zeros(3)])
            quaternions = np.vstack([quaternions, [1.0, 0.0, 0.0, 0.0]])
        if frames:
            message = TransformMessages(frames)
            self._static.publish(message.serialised(0, translations, quaternions))
