"""Bags (rosbag2, MCAP): images as topics, `calibration.toml` and `background/` in the folder."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from markerless_tracker.camera import CameraModel, CameraRig, read_calibration
from markerless_tracker.camera.model import nominal_camera
from markerless_tracker.datasets.bag.calibration import rig_from_messages
from markerless_tracker.datasets.bag.encodings import decode_compressed, decode_raw
from markerless_tracker.datasets.bag.files import mcap_files
from markerless_tracker.datasets.bag.sets import SetGrouping, StampedSet
from markerless_tracker.datasets.bag.stream import FIRST, IndexDamaged, McapFiles, Place, RawMessage
from markerless_tracker.datasets.recording import FrameSet, Recording
from markerless_tracker.datasets.video.rates import tidy_fps
from markerless_tracker.errors import DatasetError, ImageError
from markerless_tracker.imaging import Image, scale_image

RAW_TYPE = "sensor_msgs/msg/Image"
COMPRESSED_TYPE = "sensor_msgs/msg/CompressedImage"
INFO_TYPE = "sensor_msgs/msg/CameraInfo"
TF_TYPE = "tf2_msgs/msg/TFMessage"
# Number of sets from which the rate is measured.
RATE_SETS = 30
LONE_SET_FPS = 60.0


class BagRecording(Recording):
    """A bag with the images of a rig on `NAME/image_raw` or `NAME/image_raw/compressed`.

    Images whose headers have the same stamp form a set; incomplete sets are skipped and counted in
    `warnings`. A cut or damaged file is read up to the damage. `frame_count` is an upper bound
    unless the file is damaged. Without a `calibration.toml` in the bag's folder, the rig is read
    from `NAME/camera_info` and `/tf_static`.

    Args:
        path: the bag's folder, or its `.mcap`.
        scale: factor for all images.
        nominal: take any calibration for missing: the rig has the cameras' names and sizes only.
        checked: as for `McapFiles`.

    Raises:
        DatasetError: not an MCAP bag, topics are missing, or no set is complete.
        CalibrationError: the calibration is missing or malformed.
    """

    def __init__(
        self, path: Path, *, scale: float = 1.0, nominal: bool = False, checked: bool = True
    ) -> None:
        folder = path if path.is_dir() else path.parent
        names: tuple[str, ...]
        self._files = McapFiles(mcap_files(path), checked=checked)
        self._store = get_typestore(Stores.ROS2_JAZZY)
        if self._files.counts is None:
            for _ in self._files:  # the topics of a damaged bag are known only after reading it
                pass
        self._namespaces = _namespaces(self._with_messages())
        calibration = folder / "calibration.toml"
        if nominal:
            names = self._cameras_with_images(path)
            rig = self._nominal_rig(path, names)
        elif calibration.is_file():
            rig = read_calibration(calibration)
            names = rig.names
        else:
            names = self._cameras_with_images(path)
            rig = self._rig_from_topics(path, names)
        self._topics = {self._image_topic(path, name): name for name in names}
        self._where = path
        self._set_places: dict[int, tuple[int, Place]] = {}  # index -> stamp (ns), place
        stamps = [found.stamp_ns for found in islice(self._stamped(), RATE_SETS)]
        if not stamps:
            raise DatasetError(
                f"{path}: no set of images is complete, expected one image of each of "
                f"{', '.join(names)} with the same stamp"
            )
        super().__init__(folder, rig, scale=scale, fps=_rate(stamps), frame_count=self._count())
        self._stored_rig = rig
        if len(stamps) == 1:
            self.warn(f"{self.name}: holds one set only, its rate is taken as {LONE_SET_FPS:g} fps")
        if self._files.damage:
            self.warn(self._files.damage)
        elif self._files.counts is None:
            self.warn(f"{self.name}: the file has no index, it was read through to find its topics")

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        with ThreadPoolExecutor(len(self.rig), thread_name_prefix="decode") as pool:
            for index, found in enumerate(self.stored_sets(start), start=start):
                if (index - start) % every == 0:
                    images = pool.map(self.image, found.messages.values())
                    named = dict(zip(self.rig.names, images, strict=True))
                    yield FrameSet(index, found.stamp_ns, named)

    def stored_sets(self, start: int = 0) -> Iterator[StampedSet]:
        """The complete sets from that one on, their images as stored.

        Raises:
            DatasetError: the bag ends before, or its messages have no header.
        """
        first_ns, place = self._place_of(start)
        grouping = SetGrouping(self._topics, self._where, first_ns)
        yield from grouping.sets(self._files.messages(place))
        if grouping.incomplete:
            self.warn(
                f"{self.name}: sets lacking a camera were skipped "
                f"(missing: {_counts(grouping.incomplete)})",
                replaces="incomplete",
            )
        if grouping.late:
            self.warn(
                f"{self.name}: images recorded after later ones were skipped "
                f"({_counts(grouping.late)})",
                replaces="late",
            )
        if self._files.damage:
            self.warn(self._files.damage)

    @property
    def types(self) -> Mapping[str, str]:
        """Topic -> message type of all topics of the bag."""
        return self._files.types

    @property
    def latched(self) -> Collection[str]:
        """Names of the topics that were recorded latched."""
        return self._files.latched

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """The messages of some topics in file order, up to the first damage."""
        return (message for message in self._files if message.topic in topics)

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        best = (0, 0)
        for index, found in enumerate(self._stamped()):
            stamp = found.stamp_ns
            if index == 0 or abs(stamp - stamp_ns) < abs(best[1] - stamp_ns):
                best = (index, stamp)
                self._set_places = {index: (stamp, found.place)}
            if stamp >= stamp_ns:
                break
        return best

    def _place_of(self, index: int) -> tuple[int | None, Place]:
        """Stamp (ns) of a set and the place to read from; None and the first place for set 0.

        Raises:
            DatasetError: the bag ends before.
        """
        if index == 0:
            return None, FIRST
        if index not in self._set_places:
            found = next(islice(self._stamped(), index, None), None)
            if found is None:
                raise DatasetError(f"{self.name}: has no complete set {index} to start at")
            self._set_places = {index: (found.stamp_ns, found.place)}
        return self._set_places[index]

    def _stamped(self) -> Iterator[StampedSet]:
        """The complete sets, reading only their stamps where the bag has an index."""
        count = 0
        try:
            for found in SetGrouping(self._topics, self._where).sets(
                self._files.heads(self._topics)
            ):
                yield found
                count += 1
        except IndexDamaged:
            forward = SetGrouping(self._topics, self._where).sets(self._files)
            yield from islice(forward, count, None)

    def image(self, message: RawMessage) -> Image:
        """The image of a stored message, at the recording's scale.

        Raises:
            DatasetError, ImageError: it cannot be decoded, or is not as its camera is calibrated.
        """
        name = self._topics[message.topic]
        where = f"{self.name}: {message.topic}"
        image = self._stored_image(message, where)
        stored = self._stored_rig[name].size_px
        if (image.shape[1], image.shape[0]) != stored:
            raise ImageError(
                f"{where}: an image of {image.shape[1]}x{image.shape[0]} px, "
                f"expected {stored[0]}x{stored[1]} px as {name} is calibrated"
            )
        return scale_image(image, self.rig[name].size_px)

    def _stored_image(self, message: RawMessage, where: str) -> Image:
        content = self._decoded(message)
        if message.type != RAW_TYPE:
            return decode_compressed(content.data, where=where)
        return decode_raw(
            content.data,
            encoding=content.encoding,
            width=content.width,
            height=content.height,
            step=content.step,
            where=where,
        )

    def _decoded(self, message: RawMessage) -> Any:
        try:
            return self._store.deserialize_cdr(message.data, message.type)
        except Exception as error:  # damaged bytes raise any exception
            where = f"{self._files.paths[message.place.file]}: {message.topic}"
            raise DatasetError(f"{where}: a message cannot be decoded as {message.type}") from error

    def _with_messages(self) -> dict[str, str]:
        """Type of each topic that has messages, as far as the bag states their number."""
        counts = self._files.counts or {}
        return {name: kind for name, kind in self._files.types.items() if counts.get(name, 1)}

    def _image_topic(self, path: Path, name: str) -> str:
        namespace = self._namespaces.get(name, name)
        for suffix, kind in (("image_raw", RAW_TYPE), ("image_raw/compressed", COMPRESSED_TYPE)):
            topics = [
                topic
                for topic, found in self._with_messages().items()
                if found == kind and f"/{topic.strip('/')}".endswith(f"/{namespace}/{suffix}")
            ]
            if len(topics) > 1:
                raise DatasetError(
                    f"{path}: {' and '.join(topics)} may be images of {name}, expected one topic"
                )
            if topics:
                return topics[0]
        raise DatasetError(
            f"{path}: no images of {name}, expected the topic /{name}/image_raw ({RAW_TYPE}) or "
            f"/{name}/image_raw/compressed; the bag has {self._listed()}"
        )

    def _cameras_with_images(self, path: Path) -> tuple[str, ...]:
        if not self._namespaces:
            raise DatasetError(
                f"{path}: no images, expected topics NAME/image_raw ({RAW_TYPE}) or "
                f"NAME/image_raw/compressed; the bag has {self._listed()}"
            )
        return tuple(sorted(self._namespaces))

    def _nominal_rig(self, path: Path, names: tuple[str, ...]) -> CameraRig:
        """Cameras of the sizes of the first images."""
        topics = {self._image_topic(path, name): name for name in names}
        cameras: dict[str, CameraModel] = {}
        for message in self._files:
            name = topics.get(message.topic)
            if name is not None and name not in cameras:
                image = self._stored_image(message, f"{path}: {message.topic}")
                cameras[name] = nominal_camera(name, (image.shape[1], image.shape[0]))
                if len(cameras) == len(names):
                    break
        missing = [name for name in names if name not in cameras]
        if missing:
            raise DatasetError(f"{path}: no image of {', '.join(missing)}")
        return CameraRig(tuple(cameras[name] for name in names))

    def _rig_from_topics(self, path: Path, names: tuple[str, ...]) -> CameraRig:
        infos: dict[str, Any] = {}
        transforms: list[Any] = []
        cameras = {self._namespaces[name]: name for name in names}
        for message in self._files:
            parts = message.topic.strip("/").split("/")
            if message.type == TF_TYPE and parts[-1] == "tf_static":
                transforms.extend(self._decoded(message).transforms)
            elif message.type == INFO_TYPE and parts[-1] == "camera_info":
                if (name := cameras.get("/".join(parts[:-1]))) is not None:
                    infos.setdefault(name, self._decoded(message))
        missing = [name for name in names if name not in infos]
        if missing:
            raise DatasetError(
                f"{path}: no calibration of {', '.join(missing)}, expected calibration.toml beside "
                f"the bag or the topic /{missing[0]}/camera_info; the bag has {self._listed()}"
            )
        return rig_from_messages({name: infos[name] for name in names}, transforms, where=str(path))

    def _listed(self) -> str:
        topics = ", ".join(f"{topic} ({kind})" for topic, kind in self._files.types.items())
        damage = f"; {self._files.damage}" if self._files.damage else ""
        return (topics or "no topics") + damage

    def _count(self) -> int:
        if self._files.counts is not None:
            return min(self._files.counts[topic] for topic in self._topics)
        return sum(1 for _ in self._stamped())


def _namespaces(types: Mapping[str, str]) -> dict[str, str]:
    """Camera -> namespace of its images.

    A camera is named after the last part of its namespace, and after more parts where several
    cameras have the same last one: front_camera and back_camera.
    """
    found: dict[str, list[str]] = {}
    for topic, kind in types.items():
        parts = topic.strip("/").removesuffix("/compressed").split("/")
        if kind in (RAW_TYPE, COMPRESSED_TYPE) and len(parts) > 1 and parts[-1] == "image_raw":
            found["/".join(parts[:-1])] = parts[:-1]
    for count in range(1, max(map(len, found.values()), default=1) + 1):
        named = {"_".join(parts[-count:]): space for space, parts in found.items()}
        if len(named) == len(found):
            return named
    return {space.replace("/", "__"): space for space in found}


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counter.items()))


def _rate(stamps: list[int]) -> float:
    if len(stamps) < 2:
        return LONE_SET_FPS
    return tidy_fps(1e9 / float(np.median(np.diff(stamps))))
