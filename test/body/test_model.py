"""What a body's arrays say about its parameters."""

import pytest

from markerless_tracker.body import load_body


@pytest.mark.parametrize("name", ["balan31", "person31", "humaneva34"])
def test_translations_are_the_pelvis_position(name):
    body = load_body(name, 1.75)
    names = [body.parameter_names[i] for i in body.translations]
    assert names == ["pelvis_tx", "pelvis_ty", "pelvis_tz"]
