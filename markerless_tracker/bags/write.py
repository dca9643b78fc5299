"""Writing a recording as a bag folder: MCAP rosbag2 version 9 (Jazzy), calibration, background."""

import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from markerless_tracker.bags.mcap_bag import BagWriter, check_stamp
from markerless_tracker.bags.messages import (
    camera_info_message,
    encoded_message,
    image_message,
    marker_poses_message,
    static_transforms_message,
)
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.camera import CameraRig, write_calibration
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.markers.trc import write_trc
from markerless_tracker.datasets.recording import BACKGROUND, FrameSet, Recording
from markerless_tracker.datasets.target import new_folder
from markerless_tracker.datasets.truth import TRUTH, truth_path
from markerless_tracker.datasets.writer import write_background
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.imaging import Image, write_background_model
from markerless_tracker.imaging.background import MODEL_SUFFIX

COMPRESSIONS = ("none", "zstd", "png", "jpeg")
TRUTH_TOPIC = "/ground_truth/marker_poses"
_ENCODED = ("png", "jpeg")
_SLACK_NS = 500_000
"""Largest difference between the stamps of a set and of its row of reference markers."""


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
    start: int = 0,
    every: int = 1,
    compress: str = "none",
    backgrounds: Mapping[str, Sequence[Image]] | None = None,
    progress: Callable[[int, int | None], None] | None = None,
    replace: bool = False,
) -> BagSummary:
    """Write a recording, at its scale, as a bag folder.

    Topics per camera: `/NAME/image_raw` (or `/NAME/image_raw/compressed` for png and jpeg) and
    `/NAME/camera_info`; once `/tf_static` with `map` -> NAME_optical_frame. If the recording has a
    `ground_truth.trc`: `TRUTH_TOPIC`, geometry_msgs/PoseArray of the 15 markers in order, NaN where
    one is missing. The folder also holds `calibration.toml`, `background/` (images and learned
    models, scaled like the images, lossless for every `compress`) and the `ground_truth.trc`. It
    appears when it is complete; a failure leaves nothing. Memory does not depend on the length.

    Args:
        recording: the sets to write; their stamps are kept.
        out: the new folder.
        start: index of the first set.
        every: keep every k-th set, from the first.
        compress: `none`, `zstd` (lossless chunks), `png` (lossless images) or `jpeg` (lossy ones).
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
    count = recording.frame_count
    total = None if count is None else -(-(count - start) // every)
    truth = recording.ground_truth()
    with new_folder(out, replace=replace) as folder:
        stamps: list[int] = []
        with (
            BagWriter(folder, zstd=compress == "zstd") as writer,
            ThreadPoolExecutor(len(recording.rig), thread_name_prefix="encode") as pool,
        ):
            encode = compress if compress in _ENCODED else None
            topics = _Topics(writer, recording.rig, encode, truth, pool)
            for frame in recording.frames(start=start, every=every):
                topics.write(frame)
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
        if truth is not None:
            _write_truth(folder / TRUTH, truth, recording)
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return BagSummary(Path(out), len(stamps), stamps[0], stamps[-1], size)


class _Topics:
    """The topics of a bag being written.

    Args:
        writer: of the bag.
        rig: the cameras.
        encode: `png`, `jpeg` or None for raw images.
        truth: reference markers.
        pool: encodes the images of a set.
    """

    def __init__(
        self,
        writer: BagWriter,
        rig: CameraRig,
        encode: str | None,
        truth: MarkerTrack | None,
        pool: ThreadPoolExecutor,
    ) -> None:
        self._writer, self._rig, self._encode, self._pool = writer, rig, encode, pool
        kind, suffix = ("CompressedImage", "/compressed") if encode else ("Image", "")
        self._static = writer.topic("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        self._images = {
            name: writer.topic(f"/{name}/image_raw{suffix}", f"sensor_msgs/msg/{kind}")
            for name in rig.names
        }
        self._infos = {
            name: writer.topic(f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo")
            for name in rig.names
        }
        self._truth = None if truth is None else _in_order(truth)
        self._row: int | None = None
        if truth is not None:
            self._truth_topic = writer.topic(TRUTH_TOPIC, "geometry_msgs/msg/PoseArray")

    def write(self, frame: FrameSet) -> None:
        """Write one set, before it the reference markers since the last one."""
        stamp = frame.stamp_ns
        check_stamp(stamp, f"frame {frame.index}")
        if not self._writer.messages:
            transforms = static_transforms_message(self._rig, stamp)
            self._writer.write(self._static, stamp, transforms)
        self._write_truth(stamp)
        if self._encode is None:
            messages = [image_message(frame.images[c.name], stamp, c) for c in self._rig]
        else:
            work = (
                self._pool.submit(encoded_message, frame.images[c.name], stamp, c, self._encode)
                for c in self._rig
            )
            messages = [one.result() for one in list(work)]
        for camera, image in zip(self._rig, messages, strict=True):
            info = camera_info_message(camera, stamp)
            self._writer.write(self._infos[camera.name], stamp, info)
            self._writer.write(self._images[camera.name], stamp, image)

    def _write_truth(self, stamp: int) -> None:
        if self._truth is None:
            return
        stamps = self._truth.stamps_ns
        if self._row is None:
            # Stamps of rows are rounded, so that the first row may be just before the set.
            self._row = int((stamps < stamp - _SLACK_NS).sum())
        while self._row < len(stamps) and stamps[self._row] <= stamp + _SLACK_NS:
            own = int(stamps[self._row])
            # The row of this set receives the set's stamp.
            own = stamp if abs(own - stamp) <= _SLACK_NS else own
            message = marker_poses_message(self._truth.positions_m[self._row], own)
            self._writer.write(self._truth_topic, own, message)
            self._row += 1


def _write_truth(path: Path, truth: MarkerTrack, recording: Recording) -> None:
    """Write the reference markers into a bag's folder: their file, unless they were moved."""
    file = truth_path(recording.path)
    if file.is_file() and not recording.is_moved:
        shutil.copy(file, path)
    else:
        write_trc(path, truth, recording.fps)


def _in_order(track: MarkerTrack) -> MarkerTrack:
    """The 15 markers in order, by name; NaN where the track lacks one."""
    track = track.with_pelvis()
    positions = np.full((len(track), len(MARKER_NAMES), 3), np.nan)
    for column, name in enumerate(MARKER_NAMES):
        if name in track.names:
            positions[:, column] = track.positions_m[:, track.names.index(name)]
    return MarkerTrack(MARKER_NAMES, track.stamps_ns, positions)
