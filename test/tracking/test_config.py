"""Settings: what is known, what is refused, what the presets set."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
        "edges.rule": "visible",
        "edges.term": "ssd",
        "edges.form": "published",
        "sigma.scale": 1.0,
        "sigma.rate_max": 6.0,
        "sppso.update": "iteration",
        "limits": "anatomical",
        "collision": "elliptic",
        "refinement": "none",
        "fit_shape": False,
        "prediction": 0.0,
    }
    assert published.items() <= config.by_name().items()


def test_presets_name_settings_that_exist_and_are_possible():
    assert set(PRESETS) == {"tuned", "paper"}
    for name in PRESETS:
        assert TrackerConfig.from_mapping({}, preset=name).preset == name


def test_values_overrule_the_preset_and_the_named_preset_the_given_one():
    config = TrackerConfig.from_mapping({"preset": "paper", "edge_weight": 0.25}, preset="tuned")
    assert (config.preset, config.edge_weight, config.edges.rule) == ("paper", 0.25, "visible")
    assert TrackerConfig.from_mapping({}).preset == "tuned"


def test_settings_list_every_field_with_type_default_and_doc():
    listed = TrackerConfig.settings()
    names = [s.name for s in listed]
    assert len(set(names)) == len(names)
    assert {s.name for s in ImagingSettings.settings()} < set(names)
    assert {"optimizer", "apf.layers", "pso.inertia_max", "refine.iterations"} < set(names)
    defaults = TrackerConfig.from_mapping({})
    assert list(defaults.by_name()) == names
    for entry in listed:
        assert entry.type in (str, int, float, bool), entry.name
        assert len(entry.doc) > 10, entry.name
        assert "\n" not in entry.doc, entry.name
        assert type(entry.default) is entry.type, entry.name
        assert defaults.by_name()[entry.name] == entry.default
        if entry.type in (int, float):
            assert entry.min is not None and entry.max is not None, entry.name
            assert entry.min <= entry.default <= entry.max, entry.name
        assert entry.choices is None or entry.default in entry.choices, entry.name


def test_a_mapping_makes_the_same_configuration_again():
    config = TrackerConfig.from_mapping({"preset": "paper", "seed": 7, "mask.open_px": 5})
    assert config.mask.open_px == 5
    assert TrackerConfig.from_mapping(config.as_mapping()) == config
    assert TrackerConfig.from_mapping(config.by_name()) == config
    assert config.as_mapping()["mask"]["open_px"] == 5 == config.by_name()["mask.open_px"]


def test_groups_are_nested_or_dotted():
    nested = {"seed": 2, "apf": {"layers": 4, "survival": 1}, "edges": {"form": "published"}}
    dotted = {"seed": 2, "apf.layers": 4, "apf.survival": 1.0, "edges.form": "published"}
    config = TrackerConfig.from_mapping(nested)
    assert (config.apf.layers, config.apf.survival, config.edges.form) == (4, 1.0, "published")
    assert TrackerConfig.from_mapping(dotted) == config
    mixed = {"seed": 2, "apf": {"layers": 4}, "apf.survival": 1, "edges.form": "published"}
    assert TrackerConfig.from_mapping(mixed) == config
    assert TrackerConfig.from_mapping({"edges": {"step_px": 3}}, preset="paper").edges == (
        dataclasses.replace(TrackerConfig.from_mapping({}, preset="paper").edges, step_px=3.0)
    )


@given(
    st.dictionaries(
        st.one_of(st.sampled_from(["apf", "refine", "apf.layers", "seed"]), st.text(), st.none()),
        st.recursive(
            st.one_of(st.none(), st.integers(), st.floats(), st.text()),
            lambda inner: st.dictionaries(
                st.one_of(st.sampled_from(["layers", "iterations"]), st.text(), st.integers()),
                inner,
            ),
        ),
    )
)
def test_any_mapping_is_a_configuration_or_refused_in_one_line(values):
    try:
        config = TrackerConfig.from_mapping(values)
    except ConfigError as error:
        assert "\n" not in str(error)
    else:
        assert TrackerConfig.from_mapping(config.as_mapping()) == config


def test_messages_name_the_group():
    for entry in dataclasses.fields(TrackerConfig):
        if kind := entry.metadata.get("group"):
            assert entry.name == kind.NAME


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"edge_wieght": 1.0}, "unknown setting 'edge_wieght', did you mean 'edge_weight'?"),
        ({"evaluation": 1}, "unknown setting 'evaluation', did you mean 'evaluations'?"),
        ({"zzz": 1}, "unknown setting 'zzz'"),
        ({7: 1}, "unknown setting 7"),
        ({"layers": 1}, "unknown setting 'layers', did you mean 'apf.layers'?"),
        ({"apf.layer": 1}, "unknown setting 'apf.layer', did you mean 'apf.layers'?"),
        ({"apf": {"layer": 1}}, "unknown setting 'apf.layer', did you mean 'apf.layers'?"),
        (
            {"refine": {"truncation": 1}},
            "unknown setting 'refine.truncation', did you mean 'refine",
        ),
        ({"apf": {"apf.layers": 1}}, "unknown setting 'apf.apf.layers', did you mean 'apf.layers'"),
        ({"refine": {7: 1}}, "unknown setting 'refine.7'"),
        ({"refine": 3}, "refine: got 3, expected a group of settings"),
        ({"apf": {"layers": 5}, "apf.layers": 5}, "apf.layers: given twice, nested and dotted"),
        ({"apf": {"layers": -1}}, "apf.layers: got -1, expected 0 to 100"),
        ({"pso.inertia_max": 0.05}, "pso.inertia_min: got 0.1, expected at most inertia_max, 0.05"),
        ({"edge_weight": -0.1}, "edge_weight: got -0.1, expected 0.0 to 100.0"),
        ({"edge_weight": float("nan")}, "edge_weight: got nan, expected 0.0 to 100.0"),
        ({"edge_weight": "much"}, "edge_weight: got 'much', expected float"),
        ({"evaluations": 0}, "evaluations: got 0, expected 1 to 10000000"),
        ({"evaluations": 10.5}, "evaluations: got 10.5, expected int"),
        ({"evaluations": True}, "evaluations: got True, expected int"),
        ({"threads": -1}, "threads: got -1, expected 0 to 256"),
        ({"seed": -1}, "seed: got -1, expected 0 to"),
        ({"limits": "none"}, "limits: got 'none', expected one of anatomical, bt_walking"),
        ({"sppso.update": None}, "sppso.update: got None, expected str"),
        ({"optimizer": "annealing"}, "optimizer: got 'annealing', expected one of sppso"),
        ({"preset": "fast"}, "preset is 'fast', expected one of tuned, paper"),
        ({"preset": ["paper"]}, "preset is ['paper'], expected one of tuned, paper"),
        ({"preset": None}, "preset is None, expected one of tuned, paper"),
        ({"edges.blur_px": 4}, "edges.blur_px: got 4, expected an odd number"),
        ({"fit_shape": 1}, "fit_shape: got 1, expected bool"),
    ],
)
def test_unknown_and_impossible_settings_are_refused_in_one_line(values, message):
    with pytest.raises(ConfigError) as caught:
        TrackerConfig.from_mapping(values)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_group_is_of_its_class():
    with pytest.raises(ConfigError, match="edges: got EdgeMapSettings.*expected EdgeSettings"):
        TrackerConfig(edges=ImagingSettings().edges)  # type: ignore[arg-type]


def test_a_configuration_cannot_be_changed():
    config = TrackerConfig.from_mapping({})
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.apf.layers = 3  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.seed = 3  # type: ignore[misc]
