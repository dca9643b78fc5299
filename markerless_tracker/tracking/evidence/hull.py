"""Locates people: the visual hull of the silhouettes on a grid, and the trunk in it.

A point of the room belongs to the visual hull if no camera that has it in view sees background
there (Laurentini 1994, on a grid of points). Undecided pixels never carve the hull, since legs may
look like a shadow in some views. Shadows lie on the floor, so points near the floor count only
where two cameras see a person. A connected component of the hull, with pieces above and below it,
is a person if it has a person's size and two cameras see it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from markerless_tracker.camera import CameraModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.evidence.grid import (
    COARSE_M,
    FINE_M,
    LEAST_VIEWS,
    SHADOW_HEIGHT_M,
    GridViews,
    occupied,
)

LEAST_EXTENT_M = 0.45
"""A component with a smaller extent in every direction is no person."""
LEAST_VOLUME_M3 = 0.015
LEAST_PIECE_M3 = 0.0027
"""A piece of a hull with less volume above `HIGH_M`, half a head's, does not count."""
MOST_VOLUME_M3 = 1.5
"""Limits of a person's volume. The upper one is that of a tall person seen by two cameras only,
whose hull is too large."""
MOST_COARSE_M3 = 6.0
"""The same upper limit on the coarse grid."""
LEAST_PERSON = 0.15
"""Fraction of a component's points that two cameras must see as person."""
HIGH_M = 0.35
"""Hulls of shadows on the floor are hardly higher than this. The trunk is searched above it."""
FLAT_M, AT_FLOOR_M = 0.7, 0.06
"""A hull lower than the first, with its trunk nearer to the floor's plane than the second, is a
shadow as dark as a person. The trunk of a person who lies on the floor is 0.10 m above it."""
FOOT_M, SHIN_M = 0.22, 0.16
"""Points lower than `SHIN_M` are feet only within `FOOT_M`, horizontally, of a leg above."""
TRUNK_DISTANCE_M = 0.45
"""Horizontal distance from the trunk. Beyond it, points on the floor are shadows, and so are points
lower than `HIGH_M` that no two cameras see as person. A component has no points farther than this
from those that two cameras see as person, since shadows on walls are connected to it."""
_BRIDGED = 2
"""Number of cells of the room's grid that may lie between two pieces, one above the other."""
_RADIUS_M = 5.0
_UP_M = 2.5
"""Half the width and half the height of the grid."""
TOP_M = 0.12
"""The top is the mean position of the points within this distance of the highest one."""
_FAR_M = 4.0
"""Distance of the scene from the cameras, assumed where their optical axes are parallel."""
_TRUNK_SHARE = 0.5
"""Depth from which on a point belongs to the trunk, as a fraction of the largest depth."""


@dataclass(frozen=True, eq=False)
class Hull:
    """One connected component of the visual hull.

    Attributes:
        points_m: (n, 3) points of a grid with spacing `FINE_M` that lie in it, world frame.
        trunk_m: (m, 3) the thick part: points with at least half of the largest depth, among those
            that two cameras see as person above `HIGH_M`.
        sure_m: (k, 3) points that are no shadow: high enough, or person in two views and not at the
            floor.
    """

    points_m: FloatArray
    trunk_m: FloatArray
    sure_m: FloatArray

    @property
    def low_m(self) -> float:
        """Height of its lowest point: the floor, for a standing person."""
        return float(self.points_m[:, 2].min()) - 0.5 * FINE_M

    @property
    def high_m(self) -> float:
        """Height of its highest point."""
        return float(self.points_m[:, 2].max()) + 0.5 * FINE_M

    @property
    def top_m(self) -> FloatArray:
        """(3,) its top: the head, unless the person bends or raises an arm."""
        high = self.points_m[self.points_m[:, 2] > self.high_m - TOP_M]
        return np.append(high[:, :2].mean(axis=0), self.high_m)

    @property
    def height_m(self) -> float:
        """From its lowest to its highest point, less one spacing of the grid."""
        return self.high_m - self.low_m - FINE_M

    @property
    def on_floor(self) -> bool:
        """Whether it is as flat as a shadow and lies about the floor."""
        return self.height_m < FLAT_M and abs(float(self.trunk_m[:, 2].mean())) < AT_FLOOR_M

    @classmethod
    def without_shadows(
        cls, points_m: FloatArray, depth_m: FloatArray, person: NDArray[np.bool_]
    ) -> "Hull":
        """The component without its points on the floor beside the person.

        Args:
            points_m: (n, 3) points of the component.
            depth_m: (n,) distance of each point from the component's surface.
            person: (n,) whether two cameras see a point as person.
        """
        high = (points_m[:, 2] > HIGH_M) & person
        if FINE_M**3 * high.sum() < LEAST_VOLUME_M3:
            high = np.ones(len(points_m), dtype=np.bool_)
        thick = high & (depth_m >= _TRUNK_SHARE * depth_m[high].max())
        trunk = points_m[thick]
        aside = np.linalg.norm((points_m - trunk.mean(axis=0))[:, :2], axis=1) > TRUNK_DISTANCE_M
        low = (points_m[:, 2] < SHADOW_HEIGHT_M) | ((points_m[:, 2] < HIGH_M) & ~person)
        kept = (~(aside & low) | thick) & ~_isolated_floor(points_m, ~(aside & low))
        sure = kept & (person | (points_m[:, 2] > HIGH_M)) & (points_m[:, 2] > SHIN_M)
        return cls(points_m[kept], trunk, points_m[sure])


def find_hulls(
    cameras: Mapping[str, CameraModel], observations: Mapping[str, Observation]
) -> Iterator[Hull]:
    """Components of the visual hull that may be a person, the largest first.

    A component's size is the sum, over its points, of the cameras that have the point in view.

    Args:
        cameras: cameras by name.
        observations: silhouettes of some of them.
    """
    # A view without any silhouette is left out, since its camera may be broken.
    seen = [
        (cameras[name], observation)
        for name, observation in observations.items()
        if observation.mask_words.any()
    ]
    if len(seen) < LEAST_VIEWS:
        return
    middle = _middle([cameras[name] for name in observations])
    views = GridViews.of(seen, middle)
    low = middle - (_RADIUS_M, _RADIUS_M, _UP_M)
    size = np.ceil(2.0 * np.array([_RADIUS_M, _RADIUS_M, _UP_M]) / COARSE_M).astype(np.int64)
    inside, view_count, _ = occupied(low, size, COARSE_M, views)
    # Where a view lacks a piece of the person, the hull is in pieces, one above the other.
    bridged = inside | ndimage.binary_closing(
        inside, structure=np.ones((1, 1, _BRIDGED + 1), np.bool_)
    )
    labels, count = ndimage.label(bridged, structure=np.ones((3, 3, 3), dtype=np.bool_))
    labels[~inside] = 0
    support = np.bincount(labels[inside], weights=view_count[inside], minlength=count + 1)
    boxes = ndimage.find_objects(labels)
    for number in np.argsort(-support[1:], kind="stable") + 1:
        hull = _fine(labels, int(number), boxes[number - 1], low, views)
        if hull is not None:
            yield hull


def _fine(
    labels: NDArray[np.signedinteger[Any]],
    number: int,
    box: tuple[slice, ...],
    low: FloatArray,
    views: GridViews,
) -> Hull | None:
    """A component of the coarse grid, resampled on the fine grid; None if it is no person."""
    cells = int((labels[box] == number).sum())
    if cells < 2 or COARSE_M**3 * cells > MOST_COARSE_M3:
        return None
    first = low + COARSE_M * (np.array([part.start for part in box]) - 1.0)
    extent = COARSE_M * (np.array([part.stop - part.start for part in box]) + 2.0)
    size = np.ceil(extent / FINE_M).astype(np.int64)
    near = ndimage.binary_dilation(
        np.pad(labels[box] == number, 1), structure=np.ones((3, 3, 3), dtype=np.bool_)
    )
    inside, view_count, person = occupied(first, size, FINE_M, views, near)
    inside &= _dilated(np.asarray((person & inside).any(axis=2)))[:, :, None]
    parts, count = ndimage.label(inside)
    if count == 0:
        return None
    # The coarse component may include a shadow beside the person, or space before a camera that the
    # others do not see. Either may be the larger part.
    high = person & inside
    layer = max(0, int((HIGH_M - first[2]) / FINE_M))
    high[:, :, :layer] = False
    shown = high if FINE_M**3 * high.sum() >= LEAST_VOLUME_M3 else person
    persons = np.bincount(parts[shown], weights=view_count[shown], minlength=count + 1)[1:]
    main = 1 + int(persons.argmax())
    part = parts == main
    # Other pieces above and below the part belong to the person, too.
    above = np.bincount(parts[:, :, layer:].ravel(), minlength=count + 1)
    pieces = FINE_M**3 * above >= LEAST_PIECE_M3
    pieces[[0, main]] = False
    if pieces.any():
        part |= pieces[parts] & _dilated(np.asarray((part & person).any(axis=2)))[:, :, None]
    volume = FINE_M**3 * float(part.sum())
    if not LEAST_VOLUME_M3 <= volume <= MOST_VOLUME_M3:
        return None
    bounds = ndimage.find_objects(part.view(np.uint8))[0]
    depth = np.zeros(part.shape)
    depth[bounds] = ndimage.distance_transform_edt(np.pad(part[bounds], 1))[1:-1, 1:-1, 1:-1]
    points = first + FINE_M * (np.argwhere(part) + 0.5)
    if float(np.ptp(points, axis=0).max()) < LEAST_EXTENT_M:
        return None
    if float(person[part].mean()) < LEAST_PERSON:
        return None
    hull = Hull.without_shadows(points, FINE_M * depth[part], person[part])
    return None if hull.on_floor else hull


def _dilated(footprint: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A footprint (n, m) on the fine grid, dilated by `TRUNK_DISTANCE_M`."""
    side = 2 * round(TRUNK_DISTANCE_M / FINE_M) + 1
    circle = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(cv2.dilate(footprint.astype(np.uint8), circle), np.uint8).view(np.bool_)


def _isolated_floor(points_m: FloatArray, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which points (n, 3) lie at the floor, with no kept point of a possible leg near above."""
    low = points_m[:, 2] < SHIN_M
    leg = kept & ~low & (points_m[:, 2] < HIGH_M)
    if not (low.any() and leg.any()):
        return np.zeros(len(points_m), dtype=np.bool_)
    cells = np.round((points_m[:, :2] - points_m[:, :2].min(axis=0)) / FINE_M).astype(np.int64)
    feet = np.zeros(cells.max(axis=0) + 1, dtype=np.uint8)
    feet[tuple(cells[leg].T)] = 1
    side = 2 * round(FOOT_M / FINE_M) + 1
    feet = np.asarray(
        cv2.dilate(feet, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))), np.uint8
    )
    return np.asarray(low & (feet[tuple(cells.T)] == 0))


def _middle(cameras: Sequence[CameraModel]) -> FloatArray:
    """The point (3,) nearest to all optical axes, m: the middle of the scene.

    A weak prior for a point `_FAR_M` in front of each camera makes it unique for parallel axes.
    """
    total, right = np.zeros((3, 3)), np.zeros(3)
    for camera in cameras:
        to_world = camera.T_world_cam
        axis, centre = to_world[:3, 2], to_world[:3, 3]
        across = np.eye(3) - np.outer(axis, axis)
        total += across + 0.02 * np.eye(3)
        right += across @ centre + 0.02 * (centre + _FAR_M * axis)
    return np.asarray(np.linalg.solve(total, right))
