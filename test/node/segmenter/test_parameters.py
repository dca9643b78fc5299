"""Parameters of the segmenter: its own, and every setting that may stand in a shared file."""

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.node.inputs.wire import settings_digest
from markerless_tracker.node.segmenter.parameters import (
    read_segmenter_settings,
    segmenter_descriptions,
    segmenter_values,
)
from markerless_tracker.node.tracker.parameters import read_settings

GIVEN = {"camera": "cam02", "background_dir": "empty"}


def test_its_settings_are_those_of_a_tracker_with_the_same_ones() -> None:
    shared = {"preset": "paper", "mask.open_px": 5, "evaluations": 77, "stature": None}
    shared = {name: value for name, value in shared.items() if value is not None}
    settings = read_segmenter_settings({**GIVEN, **shared, "scale": 0.5})
    assert settings.background_dir == Path("empty") and settings.scaled_size((656, 490)) == (
        328,
        245,
    )
    tracker = read_settings({"calibration_file": "c.toml", **shared})
    assert settings_digest(settings.config) == settings_digest(tracker.config)
    assert settings.config.edge_weight == tracker.config.edge_weight > 0.0


def test_every_parameter_is_described() -> None:
    values = segmenter_values(read_segmenter_settings(GIVEN))
    assert list(values) == list(segmenter_descriptions())
    assert {setting.name for setting in ImagingSettings.settings()} < set(values)
    assert values["camera"] == "cam02" and values["background_dir"] == "empty"


@pytest.mark.parametrize(
    "given, words",
    [
        ({"background_dir": "empty"}, "camera: not given, expected the camera's name"),
        ({"camera": "cam02"}, "background_dir: not given, expected a folder"),
        ({**GIVEN, "cameras": ["cam01"]}, "parameter 'cameras' is unknown, did you mean 'camera'"),
        ({**GIVEN, "scale": 2.0}, "scale: got 2.0, expected a number from 0.01 to 1"),
        ({**GIVEN, "camera": "1"}, "camera: 'NAME/image_raw' of camera '1' cannot be a topic"),
        (
            {**GIVEN, "image_topic": "NAME/image raw"},
            "image_topic: .* cannot be a topic",
        ),
        ({**GIVEN, "image_transport": "evidence"}, "image_transport: got 'evidence'"),
    ],
)
def test_what_is_wrong_is_said(given: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words.replace("(", r"\(")):
        read_segmenter_settings(given)
