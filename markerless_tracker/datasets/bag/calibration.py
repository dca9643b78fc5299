"""A rig from camera infos and static transforms, for bags without a `calibration.toml`."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, inverse, rotation_from_quaternion, transform


def rig_from_messages(
    infos: Mapping[str, Any], transforms: Iterable[Any], *, where: str
) -> CameraRig:
    """The rig that messages describe; the root of the transforms is the world.

    Args:
        infos: camera name -> sensor_msgs/CameraInfo.
        transforms: geometry_msgs/TransformStamped, parent <- child.
        where: the bag, for messages.

    Raises:
        CalibrationError: a camera is uncalibrated, its lens model is another, its frame is not
            among the transforms, or two cameras hang from different roots.
    """
    parents: dict[str, tuple[str, FloatArray]] = {}
    for stamped in transforms:
        q, t = stamped.transform.rotation, stamped.transform.translation
        if q.x == q.y == q.z == q.w == 0.0:
            raise CalibrationError(
                f"{where}: the transform to {stamped.child_frame_id} has no rotation"
            )
        T_parent_child = transform(rotation_from_quaternion((q.w, q.x, q.y, q.z)), (t.x, t.y, t.z))
        parents[stamped.child_frame_id] = (stamped.header.frame_id, T_parent_child)
    cameras, roots = [], {}
    for name, info in infos.items():
        frame = info.header.frame_id
        if frame not in parents:
            raise CalibrationError(
                f"{where}: {name}: its frame {frame!r} is in no static transform, "
                "expected a calibration.toml or /tf_static"
            )
        T_world_cam, seen = np.eye(4), {frame}
        while frame in parents:
            frame, T_parent_child = parents[frame]
            if frame in seen:
                raise CalibrationError(f"{where}: the static transforms of {name} run in a circle")
            seen.add(frame)
            T_world_cam = T_parent_child @ T_world_cam
        roots[name] = frame
        cameras.append(
            CameraModel(
                name,
                (int(info.width), int(info.height)),
                np.array(info.k, dtype=np.float64).reshape(3, 3),
                _distortion(info, f"{where}: {name}"),
                inverse(T_world_cam),
            )
        )
    if len(set(roots.values())) > 1:
        listed = ", ".join(f"{name} in {root}" for name, root in roots.items())
        raise CalibrationError(
            f"{where}: cameras hang from different frames ({listed}), expected one"
        )
    return CameraRig(tuple(cameras))


def _distortion(info: Any, where: str) -> FloatArray:
    coefficients = np.array(info.d, dtype=np.float64)
    if not coefficients.any():
        return np.zeros(5)
    if info.distortion_model != "plumb_bob" or coefficients.size not in (4, 5):
        raise CalibrationError(
            f"{where}: distortion model {info.distortion_model!r} with {coefficients.size} "
            "coefficients, expected plumb_bob with 4 or 5"
        )
    return coefficients
