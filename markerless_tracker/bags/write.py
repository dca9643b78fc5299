"""Writing a recording as a bag folder: MCAP rosbag2 version 9 (Jazzy), calibration, background."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from markerless_tracker.bags.messages import (
    camera_info_message,
    image_message,
    jpeg_message,
    static_transforms_message,
    typestore,
)
from markerless_tracker.camera import CameraRig, write_calibration
from markerless_tracker.datasets.recording import BACKGROUND, FrameSet, Recording
from markerless_tracker.datasets.target import new_folder
from markerless_tracker.datasets.writer import write_background
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.imaging import Image, write_background_model
from markerless_tracker.imaging.background import MODEL_SUFFIX

COMPRESSIONS = ("none", "zstd", "jpeg")
# Stamps of ROS have int32 seconds; later ones cannot be written.
LAST_SECOND = 2**31 - 1
_FOREVER = QosTime(2147483647, 4294967295)


@dataclass(frozen=True)
class BagSummary:
    """Contents of a bag that was written.

    Attributes:
        path: the bag's folder.
        sets: number of sets of images.
        first_ns, last_ns: stamps of the first and last set.
        bytes: size of the folder.
    """

    path: Path
    sets: int
    first_ns: int
    last_ns: int
    bytes: int


def write_bag(
    recording: Recording,
    out: str | Path,
    *,
    every: int = 1,
    compress: str = "none",
    backgrounds: Mapping[str, Sequence[Image]] | None = None,
    progress: Callable[[int, int | None], None] | None = None,
    replace: bool = False,
) -> BagSummary:
    """Write a recording, at its scale, as a bag folder.

    Topics per camera: `/NAME/image_raw` (or `/NAME/image_raw/compressed` for jpeg) and
    `/NAME/camera_info`; once `/tf_static` with `map` -> NAME_optical_frame. The folder also holds
    `calibration.toml` and `background/` (images and learned models), scaled like the images and
    lossless for every `compress`.
    The folder appears when it is complete; a failure leaves nothing.

    Args:
        recording: the sets to write; their stamps are kept.
        out: the new folder.
        every: keep every k-th set, from the first.
        compress: `none`, `zstd` (lossless chunks) or `jpeg` (lossy images).
        backgrounds: camera -> empty-scene images in the rig's size, instead of the recording's own.
        progress: called with the sets written and their number (None if unknown).
        replace: whether an earlier bag at `out` is replaced, once the new one is complete.

    Raises:
        ConfigError: an unknown compression.
        DatasetError: `out` exists or cannot be written, or the recording cannot be read.
    """
    if compress not in COMPRESSIONS:
        raise ConfigError(f"compress {compress!r}: expected one of {', '.join(COMPRESSIONS)}")
    for name in recording.rig.names:
        if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
            raise DatasetError(
                f"{name}: this camera name cannot be part of a ROS topic, expected a letter, then "
                "letters, digits and _"
            )
    total = None if recording.frame_count is None else -(-recording.frame_count // every)
    with new_folder(out, replace=replace) as folder:
        # The writer creates the folder and refuses an existing one.
        folder.rmdir()
        writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        if compress == "zstd":
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        stamps: list[int] = []
        with writer:
            topics = _Topics(writer, recording.rig, jpeg=compress == "jpeg")
            for frame in recording.frames(every=every):
                topics.write(frame, first=not stamps)
                stamps.append(frame.stamp_ns)
                if progress is not None:
                    progress(len(stamps), total)
            if not stamps:
                raise DatasetError(f"{recording.name}: has no set of images, expected at least one")
        write_calibration(folder / "calibration.toml", recording.rig)
        frames = recording.background_frames() if backgrounds is None else backgrounds
        for name, images in frames.items():
            write_background(folder / BACKGROUND, recording.rig[name], images)
        for name, model in recording.background_models().items():
            write_background_model(folder / BACKGROUND / f"{name}{MODEL_SUFFIX}", model)
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return BagSummary(Path(out), len(stamps), stamps[0], stamps[-1], size)


def offered_qos(*, latched: bool) -> Qos:
    """Reliable; a latched topic keeps its last message for late subscribers."""
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=durability,
        deadline=_FOREVER,
        lifespan=_FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOREVER,
        avoid_ros_namespace_conventions=False,
    )


class _Topics:
    """The connections of a bag being written."""

    def __init__(self, writer: Writer, rig: CameraRig, *, jpeg: bool) -> None:
        self._writer, self._rig, self._jpeg = writer, rig, jpeg
        kind, suffix = ("CompressedImage", "/compressed") if jpeg else ("Image", "")
        self._static = self._connect("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        self._images = {
            name: self._connect(f"/{name}/image_raw{suffix}", f"sensor_msgs/msg/{kind}")
            for name in rig.names
        }
        self._infos = {
            name: self._connect(f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo")
            for name in rig.names
        }

    def write(self, frame: FrameSet, *, first: bool) -> None:
        """Write one set; the static transforms are written before the first."""
        stamp = frame.stamp_ns
        if not 0 <= stamp < LAST_SECOND * 10**9:
            raise DatasetError(
                f"frame {frame.index}: its stamp {stamp} ns cannot be written to a ROS message"
            )
        if first:
            self._put(self._static, stamp, static_transforms_message(self._rig, stamp))
        for camera in self._rig:
            make = jpeg_message if self._jpeg else image_message
            self._put(self._infos[camera.name], stamp, camera_info_message(camera, stamp))
            image = make(frame.images[camera.name], stamp, camera)
            self._put(self._images[camera.name], stamp, image)

    def _connect(self, topic: str, kind: str, *, latched: bool = False) -> Any:
        return self._writer.add_connection(
            topic, kind, typestore=typestore(), offered_qos_profiles=[offered_qos(latched=latched)]
        )

    def _put(self, connection: Any, stamp_ns: int, message: Any) -> None:
        data = typestore().serialize_cdr(message, connection.msgtype)
        self._writer.write(connection, stamp_ns, data)
