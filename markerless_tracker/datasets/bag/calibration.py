"""A rig from camera infos and static transforms, for bags without a `calibration.toml`."""

from collections.abc import Iterable, Mapping
from typing import Any

from markerless_tracker.camera import CameraRig, TransformTree, camera_from_info
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
        CalibrationError: a camera is uncalibrated, its lens model is not supported, its frame is
            not among the transforms, or two cameras have different roots.
    """
    tree = TransformTree()
    cameras, roots = [], {}
    try:
        tree.add(transforms)
        for name, info in infos.items():
            frame = info.header.frame_id.lstrip("/")
            if frame not in tree:
                raise CalibrationError(
                    f"{name}: its frame {frame!r} is in no static transform, expected a "
                    "calibration.toml or /tf_static"
                )
            roots[name], T_world_cam = tree.root(frame)
            cameras.append(camera_from_info(name, info, inverse(T_world_cam), where=name))
        if len(set(roots.values())) > 1:
            listed = ", ".join(f"{name} in {root}" for name, root in roots.items())
            raise CalibrationError(f"cameras have different root frames ({listed}), expected one")
        return CameraRig(tuple(cameras))
    except CalibrationError as error:
        raise CalibrationError(f"{where}: {error}") from error
