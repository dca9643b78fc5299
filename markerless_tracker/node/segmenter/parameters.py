"""The segmenter node's parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from markerless_tracker.camera.model import scaled_size
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.node.ros import declared
from markerless_tracker.node.ros.qos import TRANSPORTS
from markerless_tracker.tracking import TrackerConfig


@dataclass(frozen=True, kw_only=True)
class SegmenterSettings:
    """Parameters of the node itself; `config` holds the settings of the imaging.

    Attributes:
        camera: its name: NAME of the topics and of the background.
        background_dir: holds the empty scene: an image, clip, folder or learned NAME.npz.
        scale: factor by which images are made smaller on arrival; the tracker's must be the same.
        image_topic: topic of the images, NAME stands for the camera.
        image_transport: images that are received; auto: raw, or compressed if only those are sent.
        config: settings of the imaging, and whether edges are used (`edge_weight` above 0).
    """

    camera: str
    background_dir: Path
    scale: float = 1.0
    image_topic: str = "NAME/image_raw"
    image_transport: str = "auto"
    config: TrackerConfig

    def scaled_size(self, size_px: tuple[int, int]) -> tuple[int, int]:
        """Size (width, height) at which images of a size are segmented."""
        return size_px if self.scale == 1.0 else scaled_size(size_px, self.scale)


_OWN = tuple(entry.name for entry in fields(SegmenterSettings) if entry.name != "config")
_DECIDING = ("preset", "optimizer", "edge_weight")
"""Settings of the search that affect the imaging, for example the preset."""


def known_parameters() -> tuple[str, ...]:
    """Every parameter that may be given.

    It includes all settings of the tracker, so that both nodes can use one file of parameters.
    """
    return (*_OWN, *(setting.name for setting in TrackerConfig.settings()))


def read_segmenter_settings(given: Mapping[str, Any]) -> SegmenterSettings:
    """Settings from the parameters a user gave, by name; None and empty texts mean "not given".

    Raises:
        ConfigError: no camera or background, an unknown name or an impossible value; names the
            parameter.
    """
    declared.check_names(given, known_parameters(), "segmenter")
    values = declared.present(given)
    for name, expected in (
        ("camera", "the camera's name (-p camera:=cam01)"),
        ("background_dir", "a folder with the empty scene (-p background_dir:=FOLDER)"),
    ):
        if name not in values:
            raise ConfigError(f"{name}: not given, expected {expected}")
    own: dict[str, Any] = {
        "camera": declared.text("camera", values["camera"]),
        "background_dir": Path(
            declared.text("background_dir", values["background_dir"])
        ).expanduser(),
    }
    if "scale" in values:
        own["scale"] = declared.number("scale", values["scale"], 0.01, 1.0)
    if "image_topic" in values:
        own["image_topic"] = declared.text("image_topic", values["image_topic"])
    if "image_transport" in values:
        own["image_transport"] = declared.choice(
            "image_transport", values["image_transport"], TRANSPORTS
        )
    rest = {name: value for name, value in values.items() if name not in _OWN}
    settings = SegmenterSettings(config=TrackerConfig.from_mapping(rest), **own)
    declared.check_topics("camera", "NAME/image_raw", [settings.camera])
    declared.check_topics("image_topic", settings.image_topic, [settings.camera])
    return settings


def segmenter_values(settings: SegmenterSettings) -> dict[str, Any]:
    """Value of every parameter in effect, in a type that ROS supports."""
    own = {name: getattr(settings, name) for name in _OWN}
    own["background_dir"] = str(settings.background_dir)
    chosen = settings.config.by_name()
    return {**own, **{name: chosen[name] for name in _used()}}


def segmenter_defaults() -> dict[str, Any]:
    """Default of every parameter; `camera` and `background_dir` have none."""
    given = SegmenterSettings(
        camera="", background_dir=Path(), config=TrackerConfig.from_mapping({})
    )
    values = segmenter_values(given)
    return {**values, "camera": None, "background_dir": None}


def segmenter_descriptions() -> dict[str, str]:
    """A one-line description of every parameter."""
    lines = declared.attribute_lines(SegmenterSettings)
    found = {name: lines[name] for name in _OWN}
    found["image_transport"] += f" ({', '.join(TRANSPORTS)})"
    docs = {setting.name: setting for setting in TrackerConfig.settings()}
    for name in _used():
        choices = docs[name].choices
        found[name] = docs[name].doc + (f" ({', '.join(map(str, choices))})" if choices else "")
    return found


def _used() -> tuple[str, ...]:
    return (*_DECIDING, *(setting.name for setting in ImagingSettings.settings()))
