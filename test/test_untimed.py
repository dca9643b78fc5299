"""Property tests do not depend on the speed of the machine."""

from hypothesis import settings


def test_property_tests_have_no_deadline() -> None:
    assert settings.default.deadline is None
