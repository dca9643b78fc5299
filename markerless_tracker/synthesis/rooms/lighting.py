"""Light of each lamp on floor and walls, and on the surfaces in the room."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.rig import look_at
from markerless_tracker.synthesis.rooms.kernels import (
    add_occlusion,
    add_visible,
    nearest_triangles,
    vertex_normals,
)
from markerless_tracker.synthesis.rooms.spec import LampSpec, RoomSpec
from markerless_tracker.synthesis.rooms.surfaces import RISE, SIZE, Plane, planes_of

_MAP = 200
"""Texels of a lamp's depth map along each side."""
_TOLERANCE_M = 0.035
_MOST = 1.6
_WRAP = 0.3
_BOUNCE = 0.4
"""Part of the light on upright surfaces that floor and walls reflect, from all directions."""
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Triangles:
    """What stands in the room.

    Attributes:
        vertices: (k, 3) m, world frame.
        triangles: (m, 3).
    """

    vertices: FloatArray
    triangles: IntArray

    def normals(self) -> FloatArray:
        """Unit normals (k, 3), outward."""
        normals = np.empty_like(self.vertices)
        vertex_normals(self.vertices, self.triangles, normals)
        return normals


class Lighting:
    """The lamps of a room.

    Args:
        room: surfaces and lamps.
    """

    def __init__(self, room: RoomSpec) -> None:
        self.room = room
        self.planes = planes_of(room)
        self._points = [_points_of(lamp) for lamp in room.lamps]

    def arriving(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Light (l, n, 3) of each lamp at points (n, 3) with unit normals (n, 3), nothing hidden.

        On the floor at the room's middle it is the lamp's share times its tint.
        """
        return np.stack(
            [
                (_direct(normals) * _strength(np.array(lamp.place_m), lamp, points, normals))[
                    :, None
                ]
                * np.array(lamp.tint)
                for lamp in self.room.lamps
            ]
        )

    def on_surface(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """All light (n, 3) at points with unit normals, nothing hidden."""
        return np.asarray(self.arriving(points, normals).sum(axis=0)) + self.ambient(normals)

    def hidden(self, solid: Triangles) -> NDArray[np.float32]:
        """Part (l, rows, columns) of each lamp that triangles hide from the sheet's texels."""
        hidden = np.zeros((len(self.room.lamps), SIZE + 4 * RISE, SIZE), dtype=np.float32)
        stamps = np.zeros(hidden.shape[1:], dtype=np.int16)
        stamp = 0
        for total, points in zip(hidden, self._points, strict=True):
            for place in points:
                stamp += 1
                for plane in self.planes:
                    cast = _cast(solid.vertices, place, plane)
                    if cast is not None:
                        cast[:, 1] -= plane.row
                        add_occlusion(
                            cast, solid.triangles, stamp, stamps[plane.rows], total[plane.rows],
                            1.0 / len(points),
                        )  # fmt: skip
        return hidden

    def on_solid(self, solid: Triangles) -> FloatArray:
        """Light (k, 3) at the vertices, what other triangles hide left out."""
        normals = solid.normals()
        middle = 0.5 * (solid.vertices.min(axis=0) + solid.vertices.max(axis=0))
        radius = float(np.linalg.norm(solid.vertices - middle, axis=1).max())
        light = self.ambient(normals)
        for lamp, points in zip(self.room.lamps, self._points, strict=True):
            arrived = np.zeros(len(normals))
            for place in points:
                open_part = np.zeros(len(normals))
                _add_open(solid, place, middle, radius, open_part)
                arrived += open_part * _strength(place, lamp, solid.vertices, normals, _WRAP)
            light += (_direct(normals) * arrived / len(points))[:, None] * np.array(lamp.tint)
        return np.minimum(light, _MOST)

    def ambient(self, normals: FloatArray) -> FloatArray:
        """Light (n, 3) on surfaces with unit normals (n, 3) that casts no shadow."""
        direct = _direct(normals)
        level = direct * (0.8 + 0.2 * normals[:, 2]) * self.room.ambient + 1.0 - direct
        return np.asarray(level[:, None] * np.array(self.room.ambient_tint))


def _direct(normals: FloatArray) -> FloatArray:
    """The part (n,) of the light that comes straight from lamps: all of it on the floor."""
    return np.asarray(1.0 - _BOUNCE * (1.0 - np.maximum(normals[:, 2], 0.0)))


def _points_of(lamp: LampSpec) -> FloatArray:
    """Points (s, 3) spread evenly over the disc of a lamp, which faces the room's middle."""
    middle = np.array(lamp.place_m)
    towards = np.array([0.0, 0.0, 0.9]) - middle
    towards /= np.linalg.norm(towards)
    side = np.cross(towards, [0.3, 0.2, 1.0] if abs(towards[2]) < 0.95 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, towards)
    k = np.arange(lamp.samples)
    radius = lamp.radius_m * np.sqrt((k + 0.5) / lamp.samples)
    angle = _GOLDEN * k
    return np.asarray(
        middle + (radius * np.cos(angle))[:, None] * side + (radius * np.sin(angle))[:, None] * up
    )


def _strength(
    place: FloatArray, lamp: LampSpec, points: FloatArray, normals: FloatArray, wrap: float = 0.0
) -> FloatArray:
    """Light (n,) from a point of a lamp; falls with the distance, more slowly than in the open.

    `wrap` is how far past grazing incidence light arrives, as a cosine: cloth and skin scatter it.
    """
    towards = place - points
    distance = np.linalg.norm(towards, axis=1)
    cosine = np.einsum("ni,ni->n", towards, normals) / distance
    cosine = np.maximum((cosine + wrap) / (1.0 + wrap), 0.0)
    middle = np.array(lamp.place_m)
    usual = float(np.linalg.norm(middle))
    return np.asarray(
        np.minimum(
            lamp.share * cosine / (middle[2] / usual) * np.minimum(usual / distance, 1.5), 1.2
        )
    )


def _cast(vertices: FloatArray, place: FloatArray, plane: Plane) -> FloatArray | None:
    """Texels (k, 2) where rays from a lamp through vertices meet a plane; None if none does."""
    height = (place[plane.axis] - plane.level_m) * plane.inward
    above = (vertices[:, plane.axis] - plane.level_m) * plane.inward
    if height <= 0.05:
        return None
    ok = (above < 0.98 * height) & (above > -0.05)
    if not ok.any():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        share = height / (height - above)
    points = place + share[:, None] * (vertices - place)
    if plane.axis != 2 and not (points[ok, 2] > 0.0).any():
        return None
    texels = plane.texels(points)
    texels[~ok] = np.nan
    return texels


def _add_open(
    solid: Triangles, place: FloatArray, middle: FloatArray, radius_m: float, total: FloatArray
) -> None:
    """Add 1 for every vertex that a point of a lamp sees, by a depth map."""
    T = look_at(place, middle + [1e-4, 0.0, 0.0])
    local = solid.vertices @ T[:3, :3].T + T[:3, 3]
    distance = float(np.linalg.norm(middle - place))
    scale = 0.5 * _MAP * max(distance - radius_m, 0.3) / radius_m
    depth = np.where(local[:, 2] > 0.05, local[:, 2], np.nan)
    points = np.column_stack([local[:, :2] / depth[:, None] * scale + 0.5 * _MAP, 1.0 / depth])
    nearness = np.zeros((_MAP, _MAP), dtype=np.float32)
    number = np.zeros((_MAP, _MAP), dtype=np.int32)
    nearest_triangles(points, solid.triangles, nearness, number)
    seen = np.nan_to_num(points[:, :2], nan=-1.0)
    add_visible(seen, local[:, 2], nearness, _TOLERANCE_M, 1.0, total)
