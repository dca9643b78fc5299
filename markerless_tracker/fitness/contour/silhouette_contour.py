"""The edges of silhouettes: signed distances around them, points and normals along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour.signed_distance import signed_distance
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation

UNDECIDED_PX = 2.0
"""There are no residuals within this distance of undecided pixels."""
# Pixels within that distance.
_AROUND = np.arange(-int(UNDECIDED_PX), int(UNDECIDED_PX) + 1)
_NEAR_UNDECIDED = (np.hypot(_AROUND[:, None], _AROUND) <= UNDECIDED_PX).astype(np.uint8)
_ALL_FREE = np.empty((0, 0), dtype=np.bool_)
_SAME_PX = 0.5
_FAR_PX = np.float32(1e4)
_SMALLEST_EDGE_PX = 12
_LEAST_MARGIN_PX = 24
# Sobel's 5x5 kernel is the outer product of these two.
_SMOOTH = (1.0, 4.0, 6.0, 4.0, 1.0)
_RISE = (-1.0, -2.0, 0.0, 2.0, 1.0)


@dataclass(frozen=True, eq=False)
class SilhouetteContour:
    """The edge of one silhouette.

    Attributes:
        distance: (h, w) float32 signed distance to the edge, px, positive outside, of a window.
        left, top: the window's first column and row in the frame.
        points, normals: (n, 2) px, points of the edge, and outward unit normals.
        spacing: (n,) px, length of edge that each point represents.
    """

    distance: NDArray[np.float32]
    left: int
    top: int
    points: FloatArray
    normals: FloatArray
    spacing: FloatArray


class ContourViews(NamedTuple):
    """The silhouettes' edges of v views.

    Attributes:
        distance: signed distance to the silhouette's edge, px, positive outside, of a window per
            view, flat; view i's starts at distance_start[i].
        distance_start: (v,).
        window: (v, 4) left, top, width, height of the window, px.
        points: (n, 2) px, points of the edges, view after view from point_start[i] on.
        normals: (n, 2) outward, unit length.
        spacing: (n,) px, length of edge that each point represents.
        point_start: (v + 1,).
    """

    distance: NDArray[np.float32]
    distance_start: NDArray[np.int64]
    window: NDArray[np.int64]
    points: FloatArray
    normals: FloatArray
    spacing: FloatArray
    point_start: NDArray[np.int64]


def silhouette_contour(
    observation: Observation, spacing_px: float, margin_px: float = _LEAST_MARGIN_PX
) -> SilhouetteContour:
    """Signed distances around a silhouette, and points along its edge, about `spacing_px` apart.

    The window is the silhouette's bounding box and a margin of `margin_px`, at least 24 px. The
    edge runs midway between pixels inside and outside. There are no points where the silhouette
    leaves the frame, and around specks. The border between person and undecided pixels is no edge:
    there are no points within `UNDECIDED_PX` of undecided pixels, and distances are very large
    where that border is nearer than any edge.
    """
    mask, undecided = observation.mask.view(np.uint8), observation.undecided
    width, height = observation.size_px
    first, row, columns, rows = cv2.boundingRect(mask)
    if rows == 0:
        nothing = np.empty((0, 2))
        return SilhouetteContour(np.empty((0, 0), np.float32), 0, 0, nothing, nothing, np.empty(0))
    first, row = first + observation.offset_px[0], row + observation.offset_px[1]
    margin = max(_LEAST_MARGIN_PX, math.ceil(margin_px))
    top, bottom = max(0, row - margin), min(height, row + rows + margin)
    left, right = max(0, first - margin), min(width, first + columns + margin)
    box = left, top, right, bottom
    window = _window(observation, mask, box)
    distance = signed_distance(window)
    known, free = distance, None
    if undecided is not None:
        known, free = _without_undecided(
            distance, window, _window(observation, undecided.view(np.uint8), box), margin
        )
    chain, spacing = _edge_pixels(window, spacing_px)
    points, normals, kept = np.empty((len(chain), 2)), np.empty((len(chain), 2)), spacing.copy()
    count = edge_points(
        distance, _ALL_FREE if free is None else free, chain, spacing, left, top, width, height,
        points, normals, kept,
    )  # fmt: skip
    return SilhouetteContour(known, left, top, points[:count], normals[:count], kept[:count])


def _edge_pixels(mask: NDArray[np.uint8], spacing_px: float) -> tuple[NDArray[Any], FloatArray]:
    """Pixels (n, 2) along the edges of a mask (h, w) of 0 and 1, and the edge length (n,) px of
    each.

    Neighbours are about `spacing_px` apart; the edges of specks are left out.
    """
    chains: list[NDArray[Any]] = [np.empty((0, 2), dtype=np.int32)]
    spacing = [np.empty(0)]
    contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) < _SMALLEST_EDGE_PX:
            continue
        whole = cv2.arcLength(contour, closed=True)
        kept = contour[:: max(1, round(spacing_px * len(contour) / whole)), 0]
        chains.append(kept)
        spacing.append(np.full(len(kept), whole / len(kept)))
    return np.concatenate(chains), np.concatenate(spacing)


def _window(
    observation: Observation, part: NDArray[np.uint8], box: tuple[int, int, int, int]
) -> NDArray[np.uint8]:
    """A window (left, top, right, bottom) of the frame, cut from an array (h, w) of the region.

    It is 0 outside of the region.
    """
    left, top, right, bottom = box
    u, v = observation.offset_px
    window = np.zeros((bottom - top, right - left), dtype=np.uint8)
    inner = np.s_[
        max(v - top, 0) : max(v + observation.height - top, 0),
        max(u - left, 0) : max(u + observation.width - left, 0),
    ]
    outer = np.s_[max(top - v, 0) : max(bottom - v, 0), max(left - u, 0) : max(right - u, 0)]
    window[inner] = part[outer]
    return window


def _without_undecided(
    distance: NDArray[np.float32],
    person: NDArray[np.uint8],
    undecided: NDArray[np.uint8],
    radius_px: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Distances (h, w), very large where the nearest edge borders on undecided pixels.

    Also returns which pixels are farther than `UNDECIDED_PX` from undecided pixels. A distance is
    valid if it is the same with all undecided pixels as person and with all as background.

    Args:
        distance: (h, w) to the edge of the person, with undecided pixels as background.
        person, undecided: (h, w), 0 or 1.
        radius_px: larger distances need not be corrected.
    """
    free = np.ones(person.shape, dtype=np.bool_)
    left, top, width, height = cv2.boundingRect(undecided)
    if width == 0:
        return distance, free
    # Distances up to `radius_px` differ only within that radius of undecided pixels, and depend
    # only on pixels within that radius again.
    columns, rows = person.shape[1], person.shape[0]
    patch = Region(left, top, left + width, top + height).grown(radius_px, (columns, rows))
    around = patch.grown(radius_px, (columns, rows))
    wider = signed_distance(np.ascontiguousarray((person | undecided)[around.slices]))
    beside = np.asarray(cv2.dilate(undecided[patch.slices], _NEAR_UNDECIDED), np.uint8)
    known = distance.copy()
    inner = patch.relative_to(around)
    keep_same(wider, inner.left, inner.top, beside, patch.left, patch.top, known, free)
    return known, free


@kernel
def keep_same(wider, inner_left, inner_top, beside, left, top, known, free):  # type: ignore[no-untyped-def]
    """Keep the distances of a patch that are valid; set the others very large. Fill `free`.

    Args:
        wider: distances to the edge of person and undecided pixels together, around the patch.
        inner_left, inner_top: the patch's corner in `wider`.
        beside: (a, b) of the patch, not 0 within `UNDECIDED_PX` of undecided pixels.
        left, top: the patch's corner in `known` and `free`.
        known: (h, w) distances to the edge of the person, changed in the patch.
        free: (h, w) whether a pixel is farther than `UNDECIDED_PX` from undecided pixels, filled in
            the patch.
    """
    for i in range(beside.shape[0]):
        for j in range(beside.shape[1]):
            v, u = top + i, left + j
            free[v, u] = beside[i, j] == 0
            apart = abs(wider[inner_top + i, inner_left + j] - known[v, u])
            if beside[i, j] != 0 or apart >= _SAME_PX:
                known[v, u] = _FAR_PX


@kernel
def edge_points(  # type: ignore[no-untyped-def]
    distance, free, pixels, spacing, left, top, width, height, points, normals, kept
):
    """Fill the points of an edge and their outward normals; returns their number.

    Normals are the gradients of the distance, by Sobel's 5x5 kernel. There are no points where the
    gradient is 0, at the border of the frame, and beside undecided pixels.

    Args:
        distance: (h, w) of a window of the frame.
        free: (h, w) whether a pixel is not beside undecided pixels; (0, 0) if all are free.
        pixels, spacing: (n, 2) along the edge, in the window; (n,) px of edge that each represents.
        left, top: of the window in the frame.
        width, height: of the frame.
        points, normals, kept: (n, 2), (n, 2) and (n,), filled as in `SilhouetteContour`.
    """
    rows, columns = distance.shape
    count = 0
    for n in range(pixels.shape[0]):
        column, row = pixels[n, 0], pixels[n, 1]
        u, v = column + left, row + top
        if not (0 < u < width - 1 and 0 < v < height - 1):
            continue
        if free.size > 0 and not free[row, column]:
            continue
        along_u, along_v = 0.0, 0.0
        for i in range(5):
            y = min(max(row + i - 2, 0), rows - 1)
            for j in range(5):
                x = min(max(column + j - 2, 0), columns - 1)
                along_u += _SMOOTH[i] * _RISE[j] * distance[y, x]
                along_v += _RISE[i] * _SMOOTH[j] * distance[y, x]
        length = np.sqrt(along_u * along_u + along_v * along_v)
        if length > 0.0:
            normals[count, 0], normals[count, 1] = along_u / length, along_v / length
            points[count, 0] = u + 0.5 * normals[count, 0]
            points[count, 1] = v + 0.5 * normals[count, 1]
            kept[count] = spacing[n]
            count += 1
    return count


def join_edges(edges: Sequence[SilhouetteContour]) -> ContourViews:
    """The edges of several views as the kernels read them."""
    sizes = [edge.distance.size for edge in edges]
    counts = [len(edge.points) for edge in edges]
    return ContourViews(
        distance=np.concatenate([edge.distance.ravel() for edge in edges]),
        distance_start=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        window=np.array([[e.left, e.top, *e.distance.shape[::-1]] for e in edges], dtype=np.int64),
        points=np.concatenate([edge.points for edge in edges]),
        normals=np.concatenate([edge.normals for edge in edges]),
        spacing=np.concatenate([edge.spacing for edge in edges]),
        point_start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )


def some_edges(contours: ContourViews, views: Sequence[int]) -> ContourViews:
    """The edges of some views, by index; the distances are shared."""
    rows = [np.s_[contours.point_start[i] : contours.point_start[i + 1]] for i in views]
    counts = [row.stop - row.start for row in rows]
    return contours._replace(
        distance_start=contours.distance_start[list(views)],
        window=contours.window[list(views)],
        points=np.concatenate([contours.points[row] for row in rows]),
        normals=np.concatenate([contours.normals[row] for row in rows]),
        spacing=np.concatenate([contours.spacing[row] for row in rows]),
        point_start=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )
