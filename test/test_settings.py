"""Settings as dataclass fields: documentation, types, ranges, choices."""

from dataclasses import dataclass, fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.errors import ConfigError
from markerless_tracker.settings import check_settings, setting


@dataclass(frozen=True)
class Record:
    count: int = setting(3, "how many", least=1, most=10)
    share: float = setting(0.5, "which part", least=0.0, most=1.0)
    kind: str = setting("a", "which kind", choices=("a", "b"))
    free: float = setting(1.0, "anything")
    on: bool = setting(True, "whether")

    def __post_init__(self) -> None:
        check_settings(self)


def test_fields_carry_their_documentation_and_what_they_may_be():
    found = {f.name: dict(f.metadata) for f in fields(Record)}
    assert found["count"] == {"doc": "how many", "min": 1, "max": 10}
    assert found["kind"] == {"doc": "which kind", "choices": ("a", "b")}
    assert found["free"] == {"doc": "anything"}
    assert Record() == Record(3, 0.5, "a", 1.0, True)


def test_whole_numbers_pass_as_floats_and_become_floats():
    record = Record(share=1)
    assert record.share == 1.0
    assert type(record.share) is float


@given(st.one_of(st.integers(), st.floats(), st.text(max_size=5), st.booleans(), st.none()))
def test_whatever_comes_is_kept_or_refused_naming_the_field(value):
    for name in ("count", "share", "kind", "on"):
        try:
            kept = getattr(Record(**{name: value}), name)
        except ConfigError as error:
            assert str(error).startswith(f"{name}: got ")
            assert ", expected " in str(error)
        else:
            assert kept == value
            assert type(kept) is type(getattr(Record(), name))


@pytest.mark.parametrize("value", [1, 10])
def test_ranges_include_their_ends(value):
    assert Record(count=value).count == value


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"count": 11}, "count: got 11, expected 1 to 10"),
        ({"count": 3.0}, "count: got 3.0, expected int"),
        ({"count": True}, "count: got True, expected int"),
        ({"share": float("inf")}, "share: got inf, expected 0.0 to 1.0"),
        ({"share": float("nan")}, "share: got nan, expected 0.0 to 1.0"),
        ({"share": 10**400}, f"share: got {10**400}, expected float"),
        ({"share": True}, "share: got True, expected float"),
        ({"kind": "c"}, "kind: got 'c', expected one of a, b"),
        ({"on": 1}, "on: got 1, expected bool"),
    ],
)
def test_impossible_values(values, message):
    with pytest.raises(ConfigError) as caught:
        Record(**values)
    assert str(caught.value) == message
