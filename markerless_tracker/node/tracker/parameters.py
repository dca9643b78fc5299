"""The tracker node's parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from markerless_tracker.body import STATURE_RANGE_M
from markerless_tracker.datasets.background import MAX_FRAMES
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.node.ros import declared
from markerless_tracker.node.ros.qos import EVIDENCE, TRANSPORTS
from markerless_tracker.node.ros.ros4hri import check_id
from markerless_tracker.node.ros.transforms import TF_CHOICES
from markerless_tracker.results.target import result_name
from markerless_tracker.settings import Setting
from markerless_tracker.tracking import TrackerConfig


@dataclass(frozen=True, kw_only=True)
class NodeSettings:
    """Parameters of the node itself; `config` holds the tracker's.

    Attributes:
        cameras: names of the cameras, all of `calibration_file` if left out.
        calibration_file: `calibration.toml` of the images as they come; else camera_info and TF.
        background_dir: the empty scene: an image, clip, folder or learned NAME.npz per camera.
        subject_file: sizes of the person.
        stature: the person's stature in m, without a subject file.
        start_file: TRC or pose YAML of the start pose; left out, the person is found automatically.
        scale: factor by which images are made smaller on arrival.
        result_file: NAME of NAME.trc and NAME.json; left out, nothing is written.
        overwrite: replace an earlier result of that NAME, once the first frame is tracked.
        save_dir: folder of what save_subject and save_calibration write.
        wait_for_background: start without backgrounds and wait for the service learn_background.
        learn_background_sets: sets of images that the service learn_background learns from.
        sync_tolerance: largest difference of the stamps of one set in s; 0 means equal stamps.
        stamp_offsets: s by which each camera's stamps are late, in the order of the cameras.
        image_topic: topic of a camera's images, NAME stands for the camera.
        info_topic: topic of a camera's camera infos, NAME stands for the camera.
        image_transport: images that are received; auto: raw, or compressed if only those are sent;
            evidence: none, every camera has a segmenter.
        evidence_cameras: cameras whose segmenter's evidence is received in place of images.
        tf: frames of the body on /tf: all links, the root link alone (with robot_state_publisher).
        tf_cameras: publish the optical frames of `calibration_file` on /tf_static.
        frame_prefix: begins the names of the links' frames, such as `person1/`.
        human_id: id of the person below /humans/bodies (REP-155); left out, nothing is published.
        config: the tracker's settings.
    """

    cameras: tuple[str, ...] = ()
    calibration_file: Path | None = None
    background_dir: Path | None = None
    subject_file: Path | None = None
    stature: float | None = None
    start_file: Path | None = None
    scale: float = 1.0
    result_file: Path | None = None
    overwrite: bool = False
    save_dir: Path = Path()
    wait_for_background: bool = False
    learn_background_sets: int = 20
    sync_tolerance: float = 0.0
    stamp_offsets: tuple[float, ...] = ()
    image_topic: str = "NAME/image_raw"
    info_topic: str = "NAME/camera_info"
    image_transport: str = "auto"
    evidence_cameras: tuple[str, ...] = ()
    tf: str = "links"
    tf_cameras: bool = True
    frame_prefix: str = ""
    human_id: str = ""
    config: TrackerConfig

    def takes_evidence(self, camera: str) -> bool:
        """Whether a camera's evidence is received instead of its images."""
        return self.image_transport == EVIDENCE or camera in self.evidence_cameras


_OWN = tuple(entry.name for entry in fields(NodeSettings) if entry.name != "config")
_FIRST = (
    "calibration_file",
    "background_dir",
    "stature",
    "sync_tolerance",
    "start_file",
    "result_file",
)
_FILES = (
    "calibration_file",
    "background_dir",
    "subject_file",
    "start_file",
    "result_file",
    "save_dir",
)


RANGES: Mapping[str, tuple[float, float]] = {
    "stature": STATURE_RANGE_M,
    "scale": (0.01, 1.0),
    "sync_tolerance": (0.0, 1.0),
    "learn_background_sets": (2, MAX_FRAMES),
}
"""Least and largest value of the node's own parameters."""
_OFFSET_MAX_S = 10.0
CHOICES: Mapping[str, tuple[str, ...]] = {
    "tf": TF_CHOICES,
    "image_transport": (*TRANSPORTS, EVIDENCE),
}
"""Choices of the node's own parameters."""


def parameter_names() -> tuple[str, ...]:
    """Every parameter of the tracker node that is not ROS' own."""
    return (*_OWN, *(setting.name for setting in TrackerConfig.settings()))


def held_settings() -> tuple[Setting, ...]:
    """All parameters with a range or choices."""
    lines = declared.attribute_lines(NodeSettings)
    own = (
        Setting(name, type(least), least, lines[name], None, least, most)
        for name, (least, most) in RANGES.items()
    )
    chosen = (
        Setting(name, str, values[0], lines[name], values, None, None)
        for name, values in CHOICES.items()
    )
    return (*own, *chosen, *TrackerConfig.settings())


def read_settings(given: Mapping[str, Any]) -> NodeSettings:
    """Settings from the parameters a user gave, by name; None and empty texts mean "not given".

    Raises:
        ConfigError: an unknown name or an impossible value; names the parameter.
    """
    declared.check_names(given, parameter_names(), "tracker")
    values = declared.present(given)
    own: dict[str, Any] = {
        name: Path(declared.text(name, values[name])).expanduser()
        for name in _FILES
        if name in values
    }
    if "result_file" in own:
        try:
            own["result_file"] = result_name(str(values["result_file"]))
        except DatasetError as error:
            raise ConfigError(f"result_file: {error}") from error
        own["result_file"] = own["result_file"].expanduser()
    if "stamp_offsets" in values:
        name = "stamp_offsets"
        own[name] = declared.numbers(name, values[name], -_OFFSET_MAX_S, _OFFSET_MAX_S)
    for name in ("cameras", "evidence_cameras"):
        if name in values:
            own[name] = declared.names(name, values[name])
    for name in ("stature", "scale", "sync_tolerance"):
        if name in values:
            own[name] = declared.number(name, values[name], *RANGES[name])
    for name in ("overwrite", "wait_for_background", "tf_cameras"):
        if name in values:
            own[name] = declared.flag(name, values[name])
    for name, choices in CHOICES.items():
        if name in values:
            own[name] = declared.choice(name, values[name], choices)
    for name in ("frame_prefix", "human_id", "image_topic", "info_topic"):
        if name in values:
            own[name] = declared.text(name, values[name])
    if "learn_background_sets" in values:
        name = "learn_background_sets"
        own[name] = declared.count(name, values[name], *map(int, RANGES[name]))
    for name in ("image_topic", "info_topic"):
        if "NAME" not in own.get(name, "NAME"):
            raise ConfigError(
                f"{name}: got {own[name]!r}, expected NAME where the camera's name stands"
            )
    check_id("human_id", own.get("human_id", ""))
    return NodeSettings(config=TrackerConfig.from_mapping(tracker_settings(given)), **own)


def tracker_settings(given: Mapping[str, Any]) -> dict[str, Any]:
    """The tracker's settings among the parameters a user gave, by name."""
    values = declared.present(given)
    return {name: value for name, value in values.items() if name not in _OWN}


def effective_values(settings: NodeSettings) -> dict[str, Any]:
    """Value of every parameter in effect, in a type that ROS supports (None = no value)."""
    own = {name: getattr(settings, name) for name in _OWN}
    chosen = settings.config.by_name()
    return {name: _as_parameter(value) for name, value in {**chosen, **own}.items()}


def default_values() -> dict[str, Any]:
    """Default of every parameter; None = no default."""
    return effective_values(read_settings({}))


def descriptions() -> dict[str, str]:
    """A line about every parameter: the most used ones, then the node's, then the tracker's."""
    own = declared.attribute_lines(NodeSettings)
    lines = {name: own[name] for name in dict.fromkeys((*_FIRST, *_OWN))}
    lines |= {name: f"{lines[name]} ({', '.join(values)})" for name, values in CHOICES.items()}
    for setting in TrackerConfig.settings():
        choices = f" ({', '.join(map(str, setting.choices))})" if setting.choices else ""
        lines[setting.name] = f"{setting.doc}{choices}"
    return lines


def _as_parameter(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (tuple, list)):
        return list(value) or None
    return value
