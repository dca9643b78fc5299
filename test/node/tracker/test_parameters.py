from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import yaml

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.player.parameters import PlayerSettings, read_player_settings
from markerless_tracker.node.player.parameters import descriptions as player_descriptions
from markerless_tracker.node.tracker.parameters import (
    NodeSettings,
    descriptions,
    effective_values,
    held_settings,
    parameter_names,
    read_settings,
)
from markerless_tracker.tracking import TrackerConfig

PROMISED = {
    "cameras", "calibration_file", "background_dir", "subject_file", "stature", "start_file",
    "optimizer", "body", "evaluations", "preset", "seed", "threads", "scale", "result_file",
}  # fmt: skip


def test_every_promised_parameter_and_every_setting_is_one() -> None:
    names = parameter_names()
    assert len(set(names)) == len(names)
    assert set(names) >= PROMISED | {setting.name for setting in TrackerConfig.settings()}
    values, lines = effective_values(read_settings({})), descriptions()
    assert set(values) == set(names) == set(lines)
    assert all(line and "\n" not in line for line in lines.values())
    assert set(player_descriptions()) == {entry.name for entry in fields(PlayerSettings)}


def test_an_unknown_name_gets_a_few_suggestions() -> None:
    for name in parameter_names():
        with pytest.raises(ConfigError) as error:
            read_settings({f"{name}_": 1})
        text = str(error.value)
        assert repr(name) in text and text.count(" or ") <= 2 and len(text) < 200


def test_what_is_given_is_in_effect() -> None:
    settings = read_settings(
        {
            "cameras": ["cam02", "cam01"],
            "calibration_file": "~/c.toml",
            "scale": 1,
            "seed": 7,
            "edge_weight": 2,
            "preset": "paper",
            "start_file": "",
            "stature": None,
        }
    )
    assert settings.cameras == ("cam02", "cam01")
    assert settings.calibration_file == Path.home() / "c.toml"
    assert settings.scale == 1.0 and settings.start_file is None and settings.stature is None
    assert settings.config.seed == 7 and settings.config.edge_weight == 2.0
    values = effective_values(settings)
    assert values["preset"] == "paper" and values["edges.form"] == "published"
    assert values["cameras"] == ["cam02", "cam01"] and values["start_file"] is None
    assert values["calibration_file"] == str(Path.home() / "c.toml")
    assert effective_values(read_settings({}))["cameras"] is None
    for given in ("out/walk", "out/walk.trc", "out/walk.json"):
        assert read_settings({"result_file": given}).result_file == Path("out/walk")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"seeed": 1}, "'seeed'.*'seed'"),
        ({"edge_wieght": 1.0}, "'edge_weight'"),
        ({"qqqq": 1}, r"'qqqq' is unknown, `tracker --help` lists all \d+$"),
        (
            {"background": "empty"},
            r"'background' is unknown, did you mean 'background_dir'.*\? `tracker --help` lists",
        ),
        ({"calib": "x"}, r"did you mean 'calibration_file'\?"),
        ({"iterations": 2}, "did you mean 'level_set.iterations' or 'refine.iterations'\\?"),
        ({"scale": 0.0}, "scale: got 0.0"),
        ({"scale": True}, "scale: got True"),
        ({"scale": "half"}, "scale: got 'half'"),
        ({"stature": 172}, "stature: got 172"),
        ({"cameras": "cam01"}, None),
        ({"cameras": ["a", "a"]}, "cameras: .*distinct"),
        ({"cameras": [1, 2]}, "cameras"),
        ({"calibration_file": 3}, "calibration_file: got 3"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"optimizer": "magic"}, "optimizer"),
        ({"preset": "fast"}, "preset"),
        ({"layers": 5}, "'layers' is unknown, did you mean 'apf.layers'"),
        ({"apf.layer": 5}, "'apf.layer'.*'apf.layers'"),
        ({"edges.form": "wavy"}, "edges.form: got"),
        ({"sync_tolerance": -0.1}, "sync_tolerance"),
        ({"stamp_offsets": 0.1}, "stamp_offsets: got 0.1, expected a list"),
        ({"stamp_offsets": [0.1, 11.0]}, "stamp_offsets: got 11.0"),
        ({"image_topic": "/camera/image"}, "image_topic: .* expected NAME"),
        ({"image_transport": "theora"}, "image_transport: got 'theora', expected one of auto"),
        ({"result_file": "."}, "result_file: '.' names no file, expected a name such as"),
        ({"result_file": "out/"}, "result_file: 'out/' names no file"),
        ({"human_id": "7"}, "human_id: got '7'"),
    ],
)
def test_impossible_values_name_the_parameter(given: dict[str, Any], says: str | None) -> None:
    if says is None:
        assert isinstance(read_settings(given), NodeSettings)
        return
    with pytest.raises(ConfigError, match=says) as error:
        read_settings(given)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "bag: not given"),
        ({"bag": "b", "rate": 0}, "rate: got 0"),
        ({"bag": "b", "rate": "slow"}, "rate"),
        ({"bag": "b", "loop": 1}, "loop: got 1, expected true or false"),
        ({"bag": "b", "start_offset": -1.0}, "start_offset"),
        ({"bag": "b", "lop": True}, "'lop'.*'loop'"),
        ({"bag": 5}, "bag: got 5"),
    ],
)
def test_the_players_impossible_values(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        read_player_settings(given)


def test_the_players_values() -> None:
    settings = read_player_settings({"bag": "b", "rate": 2, "loop": True})
    assert settings == PlayerSettings(bag=Path("b"), rate=2.0, loop=True)


def test_the_example_file_is_understood(project_root: Path) -> None:
    content = yaml.safe_load((project_root / "config" / "tracker.yaml").read_text())
    given = content["tracker"]["ros__parameters"]
    # ROS itself joins the names of nested keys with dots.
    given |= {f"refine.{name}": value for name, value in given.pop("refine").items()}
    settings = read_settings(given)
    assert settings.cameras == ("cam01", "cam02", "cam03", "cam04") and settings.stature == 1.72
    assert settings.config.refine.iterations == 4


def test_the_most_used_parameters_come_first_and_ranges_are_known() -> None:
    assert list(descriptions())[:6] == [
        "calibration_file", "background_dir", "stature", "sync_tolerance", "start_file",
        "result_file",
    ]  # fmt: skip
    ranges = {setting.name: (setting.min, setting.max) for setting in held_settings()}
    assert ranges["stature"] == (0.5, 2.6) and ranges["sync_tolerance"] == (0.0, 1.0)
    assert set(ranges) <= set(parameter_names())
