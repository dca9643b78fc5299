"""Chains of transforms between named frames, as tf2 publishes them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, transform

# Shorter quaternions carry no direction that could be trusted.
_MIN_QUATERNION_LENGTH = 1e-6


class TransformTree:
    """The newest transform from each frame to its parent. Leading slashes of names are dropped."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, FloatArray]] = {}

    def add(self, transforms: Iterable[Any]) -> None:
        """Add geometry_msgs/TransformStamped messages (points of the child to the parent).

        Raises:
            CalibrationError: a transform is not finite or its quaternion is zero; names the child.
        """
        for stamped in transforms:
            child = stamped.child_frame_id.lstrip("/")
            parent = stamped.header.frame_id.lstrip("/")
            self._parents[child] = (parent, _matrix(child, stamped.transform))

    def root(self, frame: str) -> tuple[str, FloatArray]:
        """The last ancestor of a frame, and the (4, 4) that takes points of the frame to it.

        A frame without a parent is its own root.

        Raises:
            CalibrationError: the frames form a cycle.
        """
        T_ancestor_frame = np.eye(4)
        ancestor = frame
        # Without a cycle no chain is longer than the number of transforms.
        for _ in range(len(self._parents) + 1):
            if ancestor not in self._parents:
                return ancestor, T_ancestor_frame
            ancestor, T_parent_child = self._parents[ancestor]
            T_ancestor_frame = T_parent_child @ T_ancestor_frame
        raise CalibrationError(f"the transforms from {frame} upwards form a cycle")

    def between(self, ancestor: str, frame: str) -> FloatArray | None:
        """The (4, 4) that takes points of a frame to an ancestor of it, None if it has no such."""
        T_above_frame = np.eye(4)
        above = frame
        for _ in range(len(self._parents) + 1):
            if above == ancestor:
                return T_above_frame
            if above not in self._parents:
                return None
            above, T_parent_child = self._parents[above]
            T_above_frame = T_parent_child @ T_above_frame
        return None

    def __contains__(self, frame: str) -> bool:
        """Whether a frame has a parent."""
        return frame in self._parents


def quaternion_xyzw(rotation: FloatArray) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w), as geometry_msgs orders it, with w >= 0."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return float(x), float(y), float(z), float(w)


def _matrix(child: str, message: Any) -> FloatArray:
    q, t = message.rotation, message.translation
    quaternion, translation = np.array([q.x, q.y, q.z, q.w]), np.array([t.x, t.y, t.z])
    length = float(np.linalg.norm(quaternion))
    if not (np.isfinite(translation).all() and np.isfinite(length)):
        raise CalibrationError(f"the transform to {child} is not finite")
    if length < _MIN_QUATERNION_LENGTH:
        raise CalibrationError(
            f"the transform to {child} has no rotation, its quaternion is {quaternion.tolist()}"
        )
    return transform(Rotation.from_quat(quaternion).as_matrix(), translation)
