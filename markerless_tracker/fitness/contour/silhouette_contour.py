"""The edges of silhouettes: signed distances around them, points and normals along them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.compiled import kernel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords, Observation, unpack_mask

_NEAR_UNDECIDED = np.array(
    [[0, 0, 1, 0, 0], [0, 1, 1, 1, 0], [1, 1, 1, 1, 1], [0, 1, 1, 1, 0], [0, 0, 1, 0, 0]], np.uint8
)
"""No residual is taken so near to undecided pixels: within 2 px."""
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


def silhouette_contour(observation: Observation, spacing_px: float) -> SilhouetteContour:
    """Signed distances around a silhouette, and points along its edge.

    The window is the silhouette's bounding box and a margin of a sixth of its height. The edge
    runs midway between pixels inside and outside; where the silhouette leaves the frame, and
    around specks, there are no points. The border of person and undecided pixels is no edge: there
    are no points within 2 px of undecided pixels, and distances are very large where
    that border is the nearest.
    """
    words = observation.mask_words
    width, height = observation.size_px
    # Only the window is unpacked.
    columns = np.flatnonzero(
        unpack_mask(np.bitwise_or.reduce(words, axis=0)[None], observation.width)[0]
    )
    rows = np.flatnonzero(words.any(axis=1))
    if rows.size == 0:
        nothing = np.empty((0, 2))
        return SilhouetteContour(np.empty((0, 0), np.float32), 0, 0, nothing, nothing, np.empty(0))
    margin = max(_LEAST_MARGIN_PX, (rows[-1] - rows[0]) // 6)
    rows, columns = rows + observation.offset_px[1], columns + observation.offset_px[0]
    top, bottom = max(0, rows[0] - margin), min(height, rows[-1] + margin + 1)
    left, right = max(0, columns[0] - margin), min(width, columns[-1] + margin + 1)
    corners = (int(left), int(top), int(right), int(bottom))
    window = _unpacked(observation, words, corners)
    inside = cv2.distanceTransform(window, cv2.DIST_L2, 5)
    distance = np.asarray(cv2.distanceTransform(1 - window, cv2.DIST_L2, 5), np.float32)
    # The edge runs midway between pixels inside and outside.
    distance -= inside
    distance += window
    distance -= 0.5
    known, free = distance, None
    if observation.undecided_words is not None:
        undecided = _unpacked(observation, observation.undecided_words, corners)
        known, free = _without_undecided(distance, window, undecided, int(margin))
    contours, _ = cv2.findContours(window, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    chains: list[NDArray[Any]] = [np.empty((0, 2), dtype=np.int32)]
    spacing = [np.empty(0)]
    for contour in contours:
        if len(contour) < _SMALLEST_EDGE_PX:
            continue
        whole = cv2.arcLength(contour, closed=True)
        kept = contour[:: max(1, round(spacing_px * len(contour) / whole)), 0]
        chains.append(kept)
        spacing.append(np.full(len(kept), whole / len(kept)))
    chain = np.concatenate(chains)
    at = chain + (left, top)
    normal = np.empty(at.shape)
    steepest(distance, chain, normal)
    length = np.linalg.norm(normal, axis=1)
    inner = (at > 0).all(axis=1) & (at < (width - 1, height - 1)).all(axis=1) & (length > 0)
    if free is not None:
        inner &= free[chain[:, 1], chain[:, 0]]
    normal = normal[inner] / length[inner, None]
    return SilhouetteContour(
        known,
        int(left),
        int(top),
        at[inner] + 0.5 * normal,
        normal,
        np.concatenate(spacing)[inner],
    )


def _unpacked(
    observation: Observation, words: MaskWords, corners: tuple[int, int, int, int]
) -> NDArray[np.uint8]:
    """A packed mask of the region in a window of the frame, (h, w) of 0 and 1."""
    left, top, right, bottom = corners
    out = np.zeros((bottom - top, right - left), dtype=np.uint8)
    u, v = observation.offset_px
    # Left, top, right and bottom of what the region has of the window.
    a, b = max(left, u), max(top, v)
    c, d = min(right, u + observation.width), min(bottom, v + observation.height)
    part = unpack_mask(words[b - v : d - v], observation.width)[:, a - u : c - u]
    out[b - top : d - top, a - left : c - left] = part
    return out


def _without_undecided(
    distance: NDArray[np.float32],
    person: NDArray[np.uint8],
    undecided: NDArray[np.uint8],
    reach: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Distances (h, w), very large where the nearest edge borders on undecided pixels.

    Also the pixels that are not near undecided ones. The nearest edge is one of
    person and background if it does not matter which of the two undecided pixels are.

    Args:
        distance: (h, w) to the edge of the person alone.
        person, undecided: (h, w), 0 or 1.
        reach: rows that are farther from undecided pixels than this, px, are left as they are.
    """
    some = np.flatnonzero(undecided.any(axis=1))
    if some.size == 0:
        return distance, np.ones(distance.shape, dtype=np.bool_)
    # Distances up to `reach` need as much around them.
    begin, end = int(some[0]) - 2 * reach, int(some[-1]) + 2 * reach + 1
    wide = slice(max(0, begin), max(0, end))
    rows = slice(max(0, begin + reach), max(0, end - reach))
    inner = slice(rows.start - wide.start, rows.stop - wide.start)
    either = person[wide] | undecided[wide]
    wider = np.asarray(cv2.distanceTransform(1 - either, cv2.DIST_L2, 5), np.float32)
    wider -= cv2.distanceTransform(either, cv2.DIST_L2, 5)
    wider += either
    wider -= 0.5
    same = np.abs(wider[inner] - distance[rows]) < _SAME_PX
    free = np.asarray(cv2.dilate(undecided, _NEAR_UNDECIDED) == 0)
    known = distance.copy()
    known[rows][~(same & free[rows])] = _FAR_PX
    return known, free


@kernel
def steepest(distance, pixels, out):  # type: ignore[no-untyped-def]
    """Fill out (n, 2) with gradients of distances (h, w) at pixels (n, 2), by Sobel's 5x5."""
    height, width = distance.shape
    for n in range(pixels.shape[0]):
        along_u, along_v = 0.0, 0.0
        for i in range(5):
            v = min(max(pixels[n, 1] + i - 2, 0), height - 1)
            for j in range(5):
                u = min(max(pixels[n, 0] + j - 2, 0), width - 1)
                along_u += _SMOOTH[i] * _RISE[j] * distance[v, u]
                along_v += _RISE[i] * _SMOOTH[j] * distance[v, u]
        out[n, 0], out[n, 1] = along_u, along_v


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
