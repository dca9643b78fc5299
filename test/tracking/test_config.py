"""Settings: what is known, what is refused, what the presets set."""

import dataclasses

import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.tracking import PRESETS, TrackerConfig


def test_paper_is_as_published():
    config = TrackerConfig.from_mapping({"preset": "paper"})
    published = {
        "preset": "paper",
        "optimizer": "sppso",
        "body": "balan31",
        "evaluations": 1000,
        "edge_weight": 1.0,
        "edge_rule": "visible",
        "edge_term": "ssd",
        "edge_form": "published",
        "sigma_scale": 1.0,
        "sigma_rate_max": 6.0,
        "update": "iteration",
        "limits": "anatomical",
        "collision": "elliptic",
        "refinement": "none",
        "fit_shape": False,
        "prediction": 0.0,
    }
    assert {key: getattr(config, key) for key in published} == published


def test_presets_name_settings_that_exist_and_are_possible():
    assert set(PRESETS) == {"tuned", "paper"}
    for name in PRESETS:
        assert TrackerConfig.from_mapping({}, preset=name).preset == name


def test_values_overrule_the_preset_and_the_named_preset_the_given_one():
    config = TrackerConfig.from_mapping({"preset": "paper", "edge_weight": 0.25}, preset="tuned")
    assert (config.preset, config.edge_weight, config.edge_rule) == ("paper", 0.25, "visible")
    assert TrackerConfig.from_mapping({}).preset == "tuned"


def test_settings_list_every_field_with_type_default_and_doc():
    listed = TrackerConfig.settings()
    assert [s.name for s in listed] == [f.name for f in dataclasses.fields(TrackerConfig)]
    assert {f.name for f in dataclasses.fields(ImagingSettings)} < {s.name for s in listed}
    defaults = TrackerConfig.from_mapping({})
    for entry in listed:
        assert entry.type in (str, int, float, bool), entry.name
        assert len(entry.doc) > 10, entry.name
        assert "\n" not in entry.doc, entry.name
        assert type(entry.default) is entry.type, entry.name
        assert getattr(defaults, entry.name) == entry.default
        assert entry.choices is None or entry.default in entry.choices, entry.name


def test_a_mapping_makes_the_same_configuration_again():
    config = TrackerConfig.from_mapping({"preset": "paper", "seed": 7, "mask_open_px": 5})
    assert TrackerConfig.from_mapping(config.as_mapping()) == config


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"edge_wieght": 1.0}, "unknown setting 'edge_wieght', did you mean 'edge_weight'?"),
        ({"evaluation": 1}, "unknown setting 'evaluation', did you mean 'evaluations'?"),
        ({"zzz": 1}, "unknown setting 'zzz'"),
        ({7: 1}, "unknown setting 7"),
        ({"edge_weight": -0.1}, "edge_weight: got -0.1, expected 0.0 to 100.0"),
        ({"edge_weight": float("nan")}, "edge_weight: got nan, expected 0.0 to 100.0"),
        ({"edge_weight": "much"}, "edge_weight: got 'much', expected float"),
        ({"evaluations": 0}, "evaluations: got 0, expected 1 to 10000000"),
        ({"evaluations": 10.5}, "evaluations: got 10.5, expected int"),
        ({"evaluations": True}, "evaluations: got True, expected int"),
        ({"threads": -1}, "threads: got -1, expected 0 to 256"),
        ({"seed": -1}, "seed: got -1, expected 0 to"),
        ({"limits": "none"}, "limits: got 'none', expected one of anatomical, bt_walking"),
        ({"update": None}, "update: got None, expected str"),
        ({"optimizer": "annealing"}, "optimizer: got 'annealing', expected one of sppso"),
        ({"preset": "fast"}, "preset is 'fast', expected one of tuned, paper"),
        ({"preset": ["paper"]}, "preset is ['paper'], expected one of tuned, paper"),
        ({"preset": None}, "preset is None, expected one of tuned, paper"),
        ({"edge_blur_px": 4}, "edge_blur_px: got 4, expected an odd number"),
        ({"fit_shape": 1}, "fit_shape: got 1, expected bool"),
    ],
)
def test_unknown_and_impossible_settings_are_refused_in_one_line(values, message):
    with pytest.raises(ConfigError) as caught:
        TrackerConfig.from_mapping(values)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_configuration_cannot_be_changed():
    config = TrackerConfig.from_mapping({})
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.seed = 3  # type: ignore[misc]
