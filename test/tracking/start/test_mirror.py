"""Limbs exchanged as in a mirror."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.tracking.start.mirror import Mirror


@pytest.mark.parametrize("name", ["person31", "balan31", "humaneva34"])
def test_markers_of_the_limbs_are_mirrored(name) -> None:
    body = load_body(name, 1.7)
    rng = np.random.default_rng(3)
    limbs = [i for i, n in enumerate(body.parameter_names) if n[:2] in ("l_", "r_")]
    pose = body.neutral.copy()
    pose[limbs] += 0.3 * rng.standard_normal(len(limbs))
    before, after = markers(body, pose), markers(body, Mirror(body).of(pose))
    for k, marker in enumerate(MARKER_NAMES):
        if marker[0] == "L" and marker[1].isupper():
            other = MARKER_NAMES.index("R" + marker[1:])
            np.testing.assert_allclose(after[other], before[k] * [1.0, -1.0, 1.0], atol=1e-9)


def test_root_trunk_and_head_stay() -> None:
    body = load_body("person31", 1.7)
    pose = body.neutral + 0.1
    fixed = [i for i, n in enumerate(body.parameter_names) if n[:2] not in ("l_", "r_")]
    np.testing.assert_array_equal(Mirror(body).of(pose)[fixed], pose[fixed])
