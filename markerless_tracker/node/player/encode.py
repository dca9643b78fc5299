"""Sets of a bag as serialised messages, unchanged if the stored ones can be published."""

from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from rclpy.serialization import serialize_message

from markerless_tracker.camera.ros_fields import optical_frame
from markerless_tracker.datasets.bag.recording import RAW_TYPE, BagRecording
from markerless_tracker.datasets.bag.stream import RawMessage
from markerless_tracker.errors import DatasetError, ImageError
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.cdr import image_bytes, read_image, with_stamp
from markerless_tracker.node.ros.images import check_layout


@dataclass(frozen=True)
class PlayedSet:
    """One set, ready to be published.

    Attributes:
        stamp_ns: time of the images.
        messages: camera -> serialised sensor_msgs/CameraInfo and sensor_msgs/Image.
        others: stored messages of other topics since the last set.
    """

    stamp_ns: int
    messages: dict[str, tuple[bytes, bytes]]
    others: list[RawMessage]


def played_sets(
    recording: BagRecording,
    start: int,
    cameras: Collection[str],
    others: Callable[[int, int], list[RawMessage]],
) -> Iterator[PlayedSet]:
    """The sets of a bag from one on, serialised.

    A stored image message is used unchanged if it is a raw image in its camera's frame; others are
    decoded and encoded again.

    Args:
        recording: the bag.
        start: number of the first set.
        cameras: names of the cameras whose images are played.
        others: gives the messages of other topics up to a set, from the times in ns at which its
            first and last image were recorded.

    Raises:
        DatasetError, ImageError: the bag ends before, or cannot be read.
    """
    if recording.frame_count is not None and start >= recording.frame_count:
        raise DatasetError(
            f"{recording.name}: start at frame {start}, but it has {recording.frame_count} frames"
        )
    infos = {camera.name: serialize_message(info_of(camera, 0)) for camera in recording.rig}
    with ThreadPoolExecutor(len(recording.rig), thread_name_prefix="decode") as pool:
        for found in recording.stored_sets(start):
            wanted = {name: raw for name, raw in found.messages.items() if name in cameras}
            names, stored = list(wanted), list(wanted.values())
            kept = [_as_stored(recording, n, raw) for n, raw in zip(names, stored, strict=True)]
            encoded = [raw for raw, data in zip(stored, kept, strict=True) if data is None]
            decoded = pool.map(recording.image, encoded)
            images = [
                image_bytes(next(decoded), found.stamp_ns, optical_frame(name))
                if data is None
                else data
                for name, data in zip(names, kept, strict=True)
            ]
            logged_ns = [raw.log_ns for raw in found.messages.values()]
            yield PlayedSet(
                found.stamp_ns,
                {
                    name: (with_stamp(infos[name], found.stamp_ns), image)
                    for name, image in zip(names, images, strict=True)
                },
                others(min(logged_ns), max(logged_ns)),
            )


def _as_stored(recording: BagRecording, name: str, raw: RawMessage) -> bytes | None:
    """The stored bytes of an image message; None if it must be encoded again."""
    if raw.type != RAW_TYPE:
        return None
    try:
        image = read_image(raw.data, raw.topic)
        check_layout(image, raw.topic)
    except ImageError:
        # Decoding reports the error.
        return None
    size_px = (image.width, image.height)
    if image.frame_id != optical_frame(name) or size_px != recording.rig[name].size_px:
        return None
    return raw.data
