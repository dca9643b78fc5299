"""Where the cameras stand, from the transforms of a ROS graph (/tf and /tf_static)."""

from collections.abc import Iterable
from typing import Any

from markerless_tracker.geometry import (
    FloatArray,
    inverse,
    rotation_from_quaternion,
    transform,
)
from markerless_tracker.node.ros.messages import WORLD_FRAME, optical_frame


class TransformTree:
    """The newest transform from each frame to its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, FloatArray]] = {}

    def update(self, transforms: Iterable[Any]) -> None:
        """Take geometry_msgs/TransformStamped messages in."""
        for stamped in transforms:
            q, t = stamped.transform.rotation, stamped.transform.translation
            T_parent_child = transform(
                rotation_from_quaternion((q.w, q.x, q.y, q.z)), (t.x, t.y, t.z)
            )
            parent, child = stamped.header.frame_id, stamped.child_frame_id
            self._parents[child.lstrip("/")] = (parent.lstrip("/"), T_parent_child)

    def T_cam_world(self, camera: str) -> FloatArray | None:
        """(4, 4), takes world points to the optical frame of a camera; None while unknown.

        The world is the frame ``map``; it must be an ancestor of the optical frame.
        """
        frame = optical_frame(camera)
        T_frame_cam = transform(((1, 0, 0), (0, 1, 0), (0, 0, 1)), (0, 0, 0))
        # A tree has no cycle; a graph that claims one must not hang us.
        for _ in range(len(self._parents) + 1):
            if frame == WORLD_FRAME:
                return inverse(T_frame_cam)
            if frame not in self._parents:
                return None
            frame, T_parent_frame = self._parents[frame]
            T_frame_cam = T_parent_frame @ T_frame_cam
        return None
