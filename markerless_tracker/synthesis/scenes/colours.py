"""Colours of a person's vertices: what looks like the floor or a wall is matched to its light."""

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.person import PARTS, Person
from markerless_tracker.synthesis.rooms.lighting import Lighting
from markerless_tracker.synthesis.scenes.spec import SceneSpec

_HEIGHTS_M = {"skin": 1.2, "hair": 1.6, "upper": 1.2, "lower": 0.5, "shoes": 0.05}
_SPECKLE = 0.02


def part_colours(spec: SceneSpec, lighting: Lighting) -> dict[str, FloatArray]:
    """Colour (3,) BGR of each part under a light of 1."""
    return {part: _matched(spec, lighting, part) for part in PARTS}


def vertex_colours(spec: SceneSpec, lighting: Lighting, person: Person) -> FloatArray:
    """Colours (k, 3) BGR of a person's vertices under a light of 1, patterns included."""
    palette = part_colours(spec, lighting)
    colours = np.array([palette[name] for name in PARTS])[person.part]
    rng = np.random.default_rng([spec.seed, 7])
    factor = 1.0 + _SPECKLE * rng.standard_normal(len(colours))
    height = person.height_m
    for i, name in enumerate(PARTS):
        paint = spec.paint[name]
        mine = person.part == i
        wave = np.sin(2.0 * np.pi * height[mine] / paint.stripe_m)
        factor[mine] *= 1.0 + paint.stripe * np.sign(wave)
    return np.asarray(colours * factor[:, None])


def _matched(spec: SceneSpec, lighting: Lighting, part: str) -> FloatArray:
    paint = spec.paint[part]
    if not paint.like:
        return np.array(paint.colour)
    if paint.like == "floor":
        seen = lighting.on_surface(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))[0]
        seen = seen * np.array(spec.room.floor.colour)
    else:
        index = spec.seed % 4
        plane = lighting.planes[1 + index]
        point = np.array([0.0, 0.0, _HEIGHTS_M[part]])
        point[plane.axis] = plane.level_m
        seen = lighting.on_surface(point[None], plane.normal[None])[0]
        seen = seen * np.array(spec.room.walls[index].colour)
    angle = 2.0 * np.pi * np.arange(12) / 12
    around = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    place = np.tile([*spec.place_m, _HEIGHTS_M[part]], (12, 1))
    light = lighting.on_surface(place, around).mean(axis=0)
    return np.asarray(np.clip((paint.ratio * seen + paint.offset) / light, 4.0, 330.0))
