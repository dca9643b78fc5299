"""Colours of a person's vertices: parts may match the floor or a wall under the room's light."""

from collections.abc import Sequence

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.person import PARTS, Person
from markerless_tracker.synthesis.rooms.lighting import Lighting, Triangles
from markerless_tracker.synthesis.rooms.view import View
from markerless_tracker.synthesis.scenes.spec import SceneSpec

_HEIGHTS_M = {"skin": 1.2, "hair": 1.6, "upper": 1.2, "lower": 0.5, "shoes": 0.05}
_SPECKLE = 0.02
_RANGE = (4.0, 330.0)


def part_light(
    person: Person, lighting: Lighting, views: Sequence[View], poses: Sequence[FloatArray]
) -> FloatArray:
    """Mean light (parts, 3) on the pixels of each part in all views at some poses (p,)."""
    total = np.zeros((len(PARTS), 3))
    count = np.zeros(len(PARTS))
    for pose in poses:
        solid = Triangles(person.posed(pose).vertices, person.triangles)
        light = lighting.on_solid(solid)[person.triangles].mean(axis=1)
        part = person.part[person.triangles[:, 0]]
        for view in views:
            seen = view.visible(solid)
            np.add.at(total, part[seen], light[seen])
            np.add.at(count, part[seen], 1.0)
    # A part that is seen nowhere (no hair) may have any light.
    return np.asarray(np.where(count[:, None] > 0.0, total / np.maximum(count, 1.0)[:, None], 1.0))


def part_colours(
    spec: SceneSpec, lighting: Lighting, light: FloatArray, floor_points: FloatArray
) -> FloatArray:
    """Colours (parts, 3) BGR under a light of 1.

    Args:
        spec: says which part looks like what.
        lighting: of the room.
        light: (parts, 3) mean light on what is seen of each part.
        floor_points: (n, 3) where the person is, on the floor.
    """
    up = np.tile([0.0, 0.0, 1.0], (len(floor_points), 1))
    floor = lighting.on_surface(floor_points, up).mean(axis=0) * spec.room.floor.colour
    colours = []
    for name, arriving in zip(PARTS, light, strict=True):
        paint = spec.paint[name]
        if paint.like == "floor":
            colour = (paint.ratio * floor + paint.offset) / arriving
        elif paint.like == "wall":
            colour = (paint.ratio * _wall(spec, lighting, name) + paint.offset) / arriving
        else:
            colour = np.array(paint.colour)
        colours.append(np.clip(colour, *_RANGE))
    return np.array(colours)


def vertex_colours(spec: SceneSpec, person: Person, palette: FloatArray) -> FloatArray:
    """Colours (k, 3) BGR of a person's vertices under a light of 1, patterns included."""
    rng = np.random.default_rng([spec.seed, 7])
    factor = 1.0 + _SPECKLE * rng.standard_normal(len(person.part))
    for i, name in enumerate(PARTS):
        paint = spec.paint[name]
        mine = person.part == i
        wave = np.sin(2.0 * np.pi * person.height_m[mine] / paint.stripe_m)
        factor[mine] *= 1.0 + paint.stripe * np.sign(wave)
    return np.asarray(palette[person.part] * factor[:, None])


def _wall(spec: SceneSpec, lighting: Lighting, part: str) -> FloatArray:
    """How the wall looks that the part is matched to, at the part's height."""
    index = spec.seed % len(spec.room.walls)
    plane = lighting.planes[1 + index]
    point = np.array([0.0, 0.0, _HEIGHTS_M[part]])
    point[plane.axis] = plane.level_m
    light = lighting.on_surface(point[None], plane.normal[None])[0]
    return np.asarray(light * spec.room.walls[index].colour)
