"""Lamps: where shadows fall, how deep and how soft they are."""

import dataclasses

import numpy as np
import pytest

from markerless_tracker.synthesis.rooms.chair import chair
from markerless_tracker.synthesis.rooms.lighting import Lighting, Triangles
from markerless_tracker.synthesis.rooms.spec import LampSpec
from markerless_tracker.synthesis.rooms.surfaces import painted
from markerless_tracker.synthesis.scenes import sample_scene

WHITE = (1.0, 1.0, 1.0)


def room(lamps, ambient=0.5):
    """A room 3 m wide around the middle with those lamps."""
    return dataclasses.replace(
        sample_scene(0).room, walls_m=(-1.5, 1.5, -1.5, 1.5), lamps=lamps, ambient=ambient,
        ambient_tint=WHITE,
    )  # fmt: skip


def lamp(place, radius=0.0, samples=1):
    return LampSpec(place, radius, samples, 0.5, WHITE)


def plate(height, half=0.1, x=0.0):
    """A horizontal square, its upper side up."""
    corners = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]) * half + [x, 0.0]
    vertices = np.column_stack([corners, np.full(4, height)])
    return Triangles(vertices, np.array([[0, 1, 2], [0, 2, 3]]))


def hidden_at(lighting, hidden, plane, points):
    texels = np.rint(lighting.planes[plane].texels(np.asarray(points, float))).astype(int)
    return hidden[0][texels[:, 1], texels[:, 0]]


def test_the_floor_in_the_middle_gets_the_shares() -> None:
    lighting = Lighting(room((lamp((1.0, -1.0, 3.0)),)))
    floor, up = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(lighting.on_surface(floor, up), 1.0)
    np.testing.assert_allclose(lighting.arriving(floor, up)[0], 0.5)
    down = lighting.on_surface(np.array([[0, 0, 1.0]]), -up)
    assert (down < 0.95).all()


def test_a_shadow_lies_where_the_ray_meets_the_floor() -> None:
    lighting = Lighting(room((lamp((0.0, 0.0, 2.0)),)))
    hidden = lighting.hidden(plate(1.0, x=0.3))
    # Twice as far from under the lamp, and twice as large.
    inside = [[0.6, 0.0, 0], [0.42, 0.18, 0], [0.78, -0.18, 0]]
    outside = [[0.3, 0.0, 0], [0.6, 0.23, 0], [0.83, 0.0, 0], [0.0, 0.0, 0]]
    np.testing.assert_allclose(hidden_at(lighting, hidden, 0, inside), 1.0)
    np.testing.assert_allclose(hidden_at(lighting, hidden, 0, outside), 0.0)


def test_a_low_lamp_casts_onto_a_wall() -> None:
    lighting = Lighting(room((lamp((-1.0, 0.0, 1.0)),)))
    vertices = np.array([[0.0, -0.1, 0.9], [0.0, 0.1, 0.9], [0.0, 0.1, 1.1], [0.0, -0.1, 1.1]])
    hidden = lighting.hidden(Triangles(vertices, np.array([[0, 1, 2], [0, 2, 3]])))
    np.testing.assert_allclose(
        hidden_at(lighting, hidden, 2, [[1.5, 0.0, 1.0], [1.5, 0.2, 1.2]]), 1
    )
    np.testing.assert_allclose(
        hidden_at(lighting, hidden, 2, [[1.5, 0.0, 1.3], [1.5, 0.3, 1.0]]), 0
    )
    # Behind the lamp there is none.
    assert hidden_at(lighting, hidden, 1, [[-1.5, 0.0, 1.0]]) == 0.0


@pytest.mark.parametrize(("radius", "least", "most"), [(0.01, 0.0, 0.04), (0.4, 0.25, 0.6)])
def test_wide_lamps_have_soft_shadows(radius, least, most) -> None:
    lighting = Lighting(room((lamp((0.0, 0.0, 3.0), radius, 40),)))
    # The edge lies 2 m below the plate and 1 m above the floor.
    hidden = lighting.hidden(plate(1.0, half=0.3))
    line = hidden_at(lighting, hidden, 0, [[x, 0.0, 0.0] for x in np.arange(0.0, 1.2, 0.01)])
    assert line[0] == pytest.approx(1.0) and line[-1] == 0.0
    assert least <= 0.01 * np.count_nonzero((line > 0.02) & (line < 0.98)) <= most


def test_what_lies_below_something_is_darker() -> None:
    lighting = Lighting(room((lamp((0.0, 0.0, 3.0)),)))
    above, below = plate(1.5, half=0.4), plate(0.5, half=0.2)
    both = Triangles(
        np.concatenate([above.vertices, below.vertices]),
        np.concatenate([above.triangles, below.triangles + 4]),
    )
    light = lighting.on_solid(both)
    np.testing.assert_allclose(light[4:], 0.5, atol=1e-6)
    assert (light[:4] > 0.9).all()


def test_texture_has_the_mean_and_the_contrast_asked_for() -> None:
    spec = sample_scene(5).room
    floor = dataclasses.replace(
        spec.floor, colour=(128.0, 128.0, 128.0), contrast=12.0, pattern="carpet"
    )
    sheet = painted(dataclasses.replace(spec, floor=floor))
    mine = sheet[: sheet.shape[1]]
    assert mine.mean() == pytest.approx(128.0, abs=0.5)
    assert mine[..., 0].std() == pytest.approx(12.0, rel=0.05)


def test_a_chair_stands_on_the_floor_and_faces_outward() -> None:
    vertices, triangles = chair(0.45, (0.3, -0.2), 0.7)
    assert vertices[:, 2].min() == 0.0 and 0.8 < vertices[:, 2].max() < 1.0
    seat = vertices[np.abs(vertices[:, 2] - 0.45) < 1e-9]
    assert np.linalg.norm(seat[:, :2].mean(axis=0) - [0.3, -0.2]) < 0.05
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    # Closed and wound outward: the divergence theorem gives the wood's volume.
    wood = np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6.0
    assert 0.004 < wood < 0.02
