import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings


def test_every_setting_has_a_doc_and_is_in_a_group() -> None:
    for entry in ImagingSettings.settings():
        assert entry.doc
        assert entry.type in (float, int, bool, str)
        assert entry.name.count(".") == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("background.risk", float("nan")),
        ("background.risk", "high"),
        ("background.sigma_min", 0.0),
        ("shadow.value_min", 1.5),
        ("shadow.removal", 1),
        ("mask.open_px", -1),
        ("mask.open_px", 2.5),
        ("mask.open_px", 4),
        ("edges.form", "canny"),
        ("edges.blur_px", 4),
        ("edges.gradient", float("inf")),
    ],
)
def test_impossible_values_are_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"{name}: got") as caught:
        ImagingSettings.from_mapping({name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["shadow.value", "shadow.grey_value"])
def test_a_reversed_range_is_refused(kind: str) -> None:
    with pytest.raises(ConfigError, match=f"{kind}_min: got 0.9, .*_max .0.8"):
        ImagingSettings.from_mapping(
            {f"{kind}_min": 0.9, f"{kind}_max": 0.8, "shadow.undecided": False}
        )


def test_integers_are_accepted_as_floats() -> None:
    assert ImagingSettings.from_mapping({"background.risk": 10}).background.risk == 10.0
