"""A rig from camera infos and static transforms, for bags without a `calibration.toml`."""

from collections.abc import Iterable, Mapping
from typing import Any

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.camera.ros_fields import FrameTree, lens_of
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import inverse


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
    frames = FrameTree()
    cameras, roots = [], {}
    try:
        for stamped in transforms:
            q, t = stamped.transform.rotation, stamped.transform.translation
            parent, child = stamped.header.frame_id, stamped.child_frame_id
            frames.put(parent, child, (q.w, q.x, q.y, q.z), (t.x, t.y, t.z))
        for name, info in infos.items():
            frame = info.header.frame_id
            if frame not in frames:
                raise CalibrationError(
                    f"{name}: its frame {frame!r} is in no static transform, expected it in "
                    "/tf_static, or a calibration.toml beside the bag (`record --calibration`)"
                )
            roots[name], T_root_cam = frames.up(frame)
            matrix, distortion = lens_of(info, name)
            size_px = (int(info.width), int(info.height))
            cameras.append(CameraModel(name, size_px, matrix, distortion, inverse(T_root_cam)))
    except CalibrationError as error:
        raise CalibrationError(f"{where}: {error}") from error
    if len(set(roots.values())) > 1:
        listed = ", ".join(f"{name} in {root}" for name, root in roots.items())
        raise CalibrationError(
            f"{where}: cameras hang from different frames ({listed}), expected one"
        )
    return CameraRig(tuple(cameras))
