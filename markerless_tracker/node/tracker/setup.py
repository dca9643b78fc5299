"""Builds the rig and the tracker from the node's settings."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from markerless_tracker.body import load_body, read_pose, read_subject
from markerless_tracker.body.sizes import MEAN_STATURE_M
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.calibration import read_calibration
from markerless_tracker.datasets.background import read_background, read_background_models
from markerless_tracker.errors import CalibrationError, ConfigError, TrackerError
from markerless_tracker.imaging import BackgroundModel, learn_background
from markerless_tracker.node.ros.declared import check_topics
from markerless_tracker.node.tracker.parameters import NodeSettings
from markerless_tracker.tracking import TrackerSetup, build_tracker
from markerless_tracker.tracking.setup import first_row


class RigSource:
    """Source of the rig: the calibration file, or camera infos and TF.

    Attributes:
        names: the cameras.
        rig: the rig of full-size images; None while it is not known.

    Raises:
        ConfigError: the calibration file cannot be used or lacks a camera; there is neither a file
            nor TF; or the number of offsets is not that of the cameras; names the parameter.
    """

    def __init__(self, settings: NodeSettings) -> None:
        self.rig: CameraRig | None = None
        self._tree: Any = None
        self._info_topic = settings.info_topic
        if settings.calibration_file is not None:
            with _named("calibration_file"):
                rig = read_calibration(settings.calibration_file)
            with _named("cameras"):
                self.rig = rig.selected(settings.cameras or rig.names)
            self.names = self.rig.names
            _check_topics(settings, self.names)
            self._take_offsets(settings.stamp_offsets)
            return
        if not settings.cameras:
            raise ConfigError(
                "calibration_file: not given, expected a calibration.toml, or names in `cameras` "
                "whose extrinsics come from TF"
            )
        self.names = settings.cameras
        _check_topics(settings, self.names)
        self._take_offsets(settings.stamp_offsets)
        try:
            import tf2_msgs.msg  # noqa: F401
        except ImportError as error:
            raise ConfigError(
                "calibration_file: not given, and extrinsics from TF need tf2_msgs, which is not "
                "installed"
            ) from error
        from markerless_tracker.node.ros.extrinsics import TransformTree

        self._tree = TransformTree()

    def _take_offsets(self, offsets_s: tuple[float, ...]) -> None:
        if offsets_s and len(offsets_s) != len(self.names):
            raise ConfigError(
                f"stamp_offsets: got {len(offsets_s)} values, expected one for each of "
                f"{', '.join(self.names)}"
            )
        self._offsets_ns = {
            name: round(offset_s * 1e9)
            for name, offset_s in zip(self.names, offsets_s, strict=False)
        }

    def offset_ns(self, camera: str) -> int:
        """Time by which a camera's stamps are late."""
        return self._offsets_ns.get(camera, 0)

    @property
    def offsets_s(self) -> dict[str, float]:
        """Times by which the stamps of all cameras are late, s, in their order."""
        return {name: 1e-9 * self.offset_ns(name) for name in self.names}

    def listen(self, node: Any, report: Callable[[str], None]) -> None:
        """Subscribe to TF if it is needed.

        Args:
            node: creates the subscriptions.
            report: called with a line about a transform that cannot be used.
        """
        if self._tree is None:
            return
        from tf2_msgs.msg import TFMessage

        from markerless_tracker.node.ros.qos import image_qos, latched_qos

        def take(message: Any) -> None:
            try:
                self._tree.update(message.transforms)
            except CalibrationError as error:
                report(f"TF: {error}")

        static = latched_qos()
        static.depth = 100
        node.create_subscription(TFMessage, "/tf_static", take, static)
        node.create_subscription(TFMessage, "/tf", take, image_qos(depth=100))

    def try_rig(self, infos: Mapping[str, Any]) -> CameraRig | None:
        """The rig; None while a message for it is missing.

        Args:
            infos: sensor_msgs/CameraInfo of each camera; None if it has sent none.

        Raises:
            CalibrationError: a camera info cannot be used.
        """
        if self.rig is not None:
            return self.rig
        from markerless_tracker.node.ros.camera_info import camera_of

        cameras = []
        for name in self.names:
            T_cam_world = self._tree.T_cam_world(name)
            if T_cam_world is None or infos[name] is None:
                return None
            topic = self._info_topic.replace("NAME", name)
            cameras.append(camera_of(name, infos[name], T_cam_world, topic))
        self.rig = CameraRig(tuple(cameras))
        return self.rig

    def missing(self) -> list[str]:
        """Descriptions of the missing transforms."""
        if self._tree is None or self.rig is not None:
            return []
        from markerless_tracker.camera.ros_fields import WORLD_FRAME, optical_frame

        return [
            f"TF {WORLD_FRAME} -> {optical_frame(name)}"
            for name in self.names
            if self._tree.T_cam_world(name) is None
        ]


def build(settings: NodeSettings, rig: CameraRig, scaled: CameraRig) -> TrackerSetup:
    """The tracker that the settings describe.

    Args:
        settings: of the node.
        rig: cameras of the full-size images.
        scaled: cameras of the scaled images, which the tracker uses.

    Raises:
        TrackerError: a file cannot be read, or does not fit the rig; names the parameter.
    """
    _check_person(settings)
    with _named("background_dir"):
        backgrounds = _backgrounds(settings, rig, scaled)
    return build_tracker(
        scaled,
        settings.config,
        backgrounds=backgrounds,
        subject_file=settings.subject_file,
        stature=settings.stature,
        start_file=settings.start_file,
    )


def _check_person(settings: NodeSettings) -> None:
    """Check that the files of the start and the person can be used.

    Raises:
        ConfigError: a file cannot be used; names the parameter.
    """
    if settings.subject_file is not None:
        with _named("subject_file"):
            read_subject(settings.subject_file)
    start = settings.start_file
    if start is None:
        return
    with _named("start_file"):
        if start.suffix.lower() == ".trc":
            first_row(start)
            return
        with _named("no start pose"):
            read_pose(start, load_body(settings.config.body, MEAN_STATURE_M))
        if settings.subject_file is None and settings.stature is None:
            raise ConfigError(
                f"{start} gives a pose without the person's sizes, expected subject_file or "
                "stature besides, or a TRC"
            )


@contextmanager
def _named(what: str) -> Iterator[None]:
    """Prefix errors with the name of the parameter."""
    try:
        yield
    except TrackerError as error:
        raise ConfigError(f"{what}: {error}") from error


def _backgrounds(
    settings: NodeSettings, rig: CameraRig, scaled: CameraRig
) -> dict[str, BackgroundModel]:
    folder = settings.background_dir
    names = [name for name in rig.names if not settings.takes_evidence(name)]
    if not names:
        return {}
    rig, scaled = rig.selected(names), scaled.selected(names)
    if settings.wait_for_background and not (folder and folder.is_dir()):
        return {}
    if folder is None:
        raise ConfigError(
            "not given, expected a folder with an image, clip or learned model of "
            f"the empty scene for each of {', '.join(rig.names)}"
        )
    sizes_px = {camera.name: camera.size_px for camera in rig}
    # The folder may hold the backgrounds of cameras that are not used.
    models = read_background_models(folder, scaled, stored_sizes_px=sizes_px, ignore_others=True)
    frames = read_background(folder, scaled, stored_sizes_px=sizes_px, ignore_others=True)
    missing = [name for name in rig.names if name not in models and name not in frames]
    if missing and settings.wait_for_background:
        # Learning replaces all backgrounds, including those in the folder.
        return {}
    if missing:
        raise ConfigError(
            f"{folder} holds nothing for {', '.join(missing)}, "
            "expected an image, clip or learned model (.npz) named after each camera"
        )
    learned = {
        name: learn_background(images, settings.config, camera=name)
        for name, images in frames.items()
        if name not in models
    }
    return models | learned


def _check_topics(settings: NodeSettings, cameras: Sequence[str]) -> None:
    """Raise a ConfigError if a camera's name, or a topic, is none that ROS allows."""
    check_topics("cameras", "NAME/image_raw", cameras)
    check_topics("image_topic", settings.image_topic, cameras)
    check_topics("info_topic", settings.info_topic, cameras)
