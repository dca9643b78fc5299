"""What a body's arrays say about its parameters."""

from dataclasses import replace

import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import BodyModelError


@pytest.mark.parametrize("name", ["balan31", "person31", "humaneva34"])
def test_translations_are_the_pelvis_position(name):
    body = load_body(name, 1.75)
    names = [body.parameter_names[i] for i in body.translations]
    assert names == ["pelvis_tx", "pelvis_ty", "pelvis_tz"]


@pytest.mark.parametrize("array", ["cone_length", "cone_shape"])
def test_a_cone_without_a_size_is_refused_by_name(array):
    body = load_body("balan31", 1.75)
    sizes = getattr(body, array).copy()
    sizes[2] = -0.1
    with pytest.raises(BodyModelError, match=rf"balan31, cone {body.cone_names[2]}: .* -0.1 m"):
        replace(body, **{array: sizes})
