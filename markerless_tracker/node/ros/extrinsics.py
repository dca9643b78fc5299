"""Extrinsics of the cameras from the transforms of a ROS graph (/tf and /tf_static)."""

from collections.abc import Iterable
from typing import Any

from markerless_tracker.camera.ros_fields import WORLD_FRAME, FrameTree, optical_frame
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, inverse


class TransformTree:
    """The newest transform from each frame to its parent, from TF messages."""

    def __init__(self) -> None:
        self._frames = FrameTree()

    def update(self, transforms: Iterable[Any]) -> None:
        """Take geometry_msgs/TransformStamped messages.

        Raises:
            CalibrationError: a message is no transform (an all-zero quaternion, NaN); the messages
                before it are taken.
        """
        for stamped in transforms:
            q, t = stamped.transform.rotation, stamped.transform.translation
            parent, child = stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/")
            self._frames.put(parent, child, (q.w, q.x, q.y, q.z), (t.x, t.y, t.z))

    def T_cam_world(self, camera: str) -> FloatArray | None:
        """(4, 4), takes world points to the optical frame of a camera; None while unknown.

        The world is the frame ``map``; it must be an ancestor of the optical frame. Frames in a
        cycle have none.
        """
        try:
            root, T_map_cam = self._frames.up(optical_frame(camera), WORLD_FRAME)
        except CalibrationError:
            return None
        return inverse(T_map_cam) if root == WORLD_FRAME else None
