"""Where the feet of the bodies stand."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, cone_transforms, load_body, markers
from markerless_tracker.fitness.soles import TOE_SHARE, ankles, floor_share

FEET = ["person31", "person32", "person34", "person35", "humaneva34"]


@pytest.mark.parametrize("name", FEET)
def test_ankles_are_the_ends_of_the_shanks(name: str) -> None:
    body = load_body(name, 1.75)
    own, shank = ankles(body), "calf" if name == "humaneva34" else "shin"
    assert [body.cone_names[c] for c in own.cone] == [f"l_{shank}", f"r_{shank}"]
    placed = cone_transforms(body, body.neutral)[own.cone]
    ends = placed[:, :, 3] + placed[:, :, 2] * body.cone_length[own.cone, None]
    both = [MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("RAnkle")]
    np.testing.assert_allclose(ends, markers(body, body.neutral)[both], atol=1e-9)


@pytest.mark.parametrize("name", FEET)
def test_the_height_of_an_ankle_is_that_above_the_lowest_point_of_the_foot(name: str) -> None:
    body = load_body(name, 1.75)
    placed, turn = cone_transforms(body, body.neutral), np.linspace(0.0, 2.0 * np.pi, 3601)
    for cone, height_m in zip(*ankles(body), strict=True):
        down = placed[cone, :, 2]
        foot = body.cone_names.index(body.cone_names[cone][0] + "_foot")
        points = []
        for end, (rx, ry, ox, oy) in enumerate(body.cone_shape[foot]):
            x, y = ox + rx * np.cos(turn), oy + ry * np.sin(turn)
            z, one = np.full_like(x, end * body.cone_length[foot]), np.ones_like(x)
            points.append(np.stack([x, y, z, one], axis=1) @ placed[foot].T)
        ankle = placed[cone, :, 3] + down * body.cone_length[cone]
        assert height_m == pytest.approx(((np.concatenate(points) - ankle) @ down).max(), abs=1e-5)
        # From bare malleoli (0.039 of the stature) to shoes; the other bodies' soles are thinner.
        assert 0.02 * 1.75 < height_m < 0.055 * 1.75


def test_another_shape_of_a_foot_has_another_height() -> None:
    body = load_body("person35", 1.75)
    shape = body.cone_shape.copy()
    shape[[name.endswith("foot") for name in body.cone_names]] *= 2.0
    thick = ankles(replace(body, cone_shape=shape))
    np.testing.assert_allclose(thick.height_m, 2.0 * ankles(body).height_m, rtol=0.2)


def test_a_body_without_feet_has_no_ankles() -> None:
    own = ankles(load_body("balan31", 1.75))
    assert own.cone.shape == own.height_m.shape == (0,)


def test_toes_count_less_than_other_parts() -> None:
    body = load_body("person32", 1.75)
    share = floor_share(body)
    foot = np.array([name.endswith("foot") for name in body.cone_names])
    np.testing.assert_array_equal(share[foot], [[1.0, TOE_SHARE]] * 2)
    np.testing.assert_array_equal(share[~foot], 1.0)
