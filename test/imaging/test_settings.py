import dataclasses

import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings


def test_every_setting_has_a_doc_and_names_are_flat() -> None:
    for entry in dataclasses.fields(ImagingSettings):
        assert entry.metadata["doc"]
        assert entry.type in (float, int, bool, str) or entry.type in (
            "float",
            "int",
            "bool",
            "str",
        )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("background_risk", float("nan")),
        ("background_risk", "high"),
        ("background_sigma_min", 0.0),
        ("shadow_value_min", 1.5),
        ("shadow_removal", 1),
        ("mask_open_px", -1),
        ("mask_open_px", 2.5),
        ("edge_form", "canny"),
        ("edge_blur_px", 4),
        ("edge_gradient", float("inf")),
    ],
)
def test_impossible_values_are_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=name) as caught:
        ImagingSettings(**{name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["shadow_value", "shadow_grey_value"])
def test_a_range_upside_down_is_refused(kind: str) -> None:
    with pytest.raises(ConfigError, match=f"{kind}_min.*{kind}_max"):
        ImagingSettings(**{f"{kind}_min": 0.9, f"{kind}_max": 0.8})


def test_whole_numbers_serve_as_floats() -> None:
    assert ImagingSettings(background_risk=10).background_risk == 10.0
