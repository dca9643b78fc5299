"""Cones that hang from a subspace's joints, against moving them."""

import numpy as np
import pytest

from markerless_tracker.body import cone_transforms, load_body
from markerless_tracker.body.parts import cones_of


@pytest.mark.parametrize("name", ["balan31", "person31"])
@pytest.mark.parametrize("subspace", ["root", "l_arm", "r_leg"])
def test_the_cones_that_move(name, subspace) -> None:
    body = load_body(name, 1.75)
    other = body.neutral.copy()
    other[body.subspaces[subspace]] += 0.3
    gap = np.abs(cone_transforms(body, other) - cone_transforms(body, body.neutral))
    np.testing.assert_array_equal(cones_of(body, subspace), (gap > 1e-9).any(axis=(1, 2)))
    assert cones_of(body, subspace) is cones_of(body, subspace)
