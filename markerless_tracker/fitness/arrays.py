"""Inputs of the kernels: bodies and views as tuples of plain arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.errors import BodyModelError, ImageError
from markerless_tracker.fitness.raster.bits import ALL, count_bits
from markerless_tracker.fitness.raster.mask_words import paste_words
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.fitness.soles import ankles, floor_share
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords, Observation

_KEPT = 32
"""Bodies and rigs whose arrays are kept."""


class BodyArrays(NamedTuple):
    """The arrays of a `BodyModel` that kernels need; shapes as in `BodyModel`.

    Attributes:
        floor_share: (c, 2) returned by the function of that name.
        ankle_cone, ankle_height: (k,) the fields of `Ankles`.
    """

    parent: NDArray[np.int64]
    fixed: FloatArray
    kind: NDArray[np.int64]
    sign: FloatArray
    parameter: NDArray[np.int64]
    cone_node: NDArray[np.int64]
    cone_fixed: FloatArray
    cone_length: FloatArray
    cone_shape: FloatArray
    floor_share: FloatArray
    ankle_cone: NDArray[np.int64]
    ankle_height: FloatArray


class ViewArrays(NamedTuple):
    """The arrays of v views. Bit masks and edge maps cover the full frames, one after the other.

    Attributes:
        rotation, translation: (v, 3, 3) and (v, 3), world to camera.
        intrinsics: (v, 5) fx, skew, cx, fy, cy.
        distortion: (v, 5) k1 k2 p1 p2 k3.
        size: (v, 2) width and height in px.
        words: (v,) words per row.
        mask: observed silhouettes, flat, column after column of words (see `raster.bits`); view i
            starts at mask_start[i].
        edges: edge maps, flat; view i starts at edge_start[i].
        observed: (v,) number of silhouette pixels.
        known: pixels that are not undecided, flat as `mask`.
    """

    rotation: FloatArray
    translation: FloatArray
    intrinsics: FloatArray
    distortion: FloatArray
    size: NDArray[np.int64]
    words: NDArray[np.int64]
    mask: NDArray[np.uint64]
    mask_start: NDArray[np.int64]
    edges: NDArray[np.uint8]
    edge_start: NDArray[np.int64]
    observed: NDArray[np.int64]
    known: NDArray[np.uint64]


@dataclass(frozen=True)
class Views:
    """The views of one frame: cameras that have an observation, and arrays in their order."""

    names: tuple[str, ...]
    arrays: ViewArrays

    def seen_by(self, cameras: Sequence[CameraModel]) -> "Views":
        """The views of some cameras, at least one, as these are calibrated.

        Masks and edge maps are shared.
        """
        kept = [self.names.index(camera.name) for camera in cameras]
        seen = self.arrays
        arrays = camera_arrays(cameras)._replace(
            mask=seen.mask,
            mask_start=seen.mask_start[kept],
            edges=seen.edges,
            edge_start=seen.edge_start[kept],
            observed=seen.observed[kept],
            known=seen.known,
        )
        return Views(tuple(camera.name for camera in cameras), arrays)


@lru_cache(maxsize=_KEPT)
def body_arrays(body: BodyModel) -> BodyArrays:
    """The kernels' arrays of a body; must not be changed.

    Raises:
        BodyModelError: more cones than `LANES`.
    """
    if len(body.cone_names) > LANES:
        raise BodyModelError(
            f"body {body.name}: {len(body.cone_names)} cones, expected {LANES} at the most"
        )
    # Copied, since read-only arrays would make numba compile the kernels once more.
    return BodyArrays(
        body.node_parent.copy(),
        body.node_fixed.copy(),
        body.node_kind.copy(),
        body.node_sign.copy(),
        body.node_parameter.copy(),
        body.cone_node.copy(),
        body.cone_fixed.copy(),
        body.cone_length.copy(),
        body.cone_shape.copy(),
        floor_share(body),
        *ankles(body),
    )


def lay_out_views(cameras: Sequence[CameraModel], observations: Mapping[str, Observation]) -> Views:
    """Views of the cameras that have an observation, in the order of the cameras.

    Raises:
        ImageError: no camera has one, or the size of a frame differs from its calibration.
    """
    seen = [camera for camera in cameras if camera.name in observations]
    if not seen:
        raise ImageError(
            f"no view to compare with: observations of {', '.join(observations) or 'no camera'}, "
            f"expected some of {', '.join(camera.name for camera in cameras)}"
        )
    masks, edges, known = [], [], []
    for camera in seen:
        observation = observations[camera.name]
        if observation.size_px != camera.size_px:
            raise ImageError(
                f"{camera.name}: observation of a {_size(observation.size_px)} frame, "
                f"its calibration says {_size(camera.size_px)}"
            )
        masks.append(_in_full_frame(observation, observation.mask_words))
        edges.append(_edges(observation))
        if observation.undecided_words is None:
            known.append(np.full(masks[-1].shape, ALL))
        else:
            known.append(~_in_full_frame(observation, observation.undecided_words))
    arrays = camera_arrays(seen)._replace(
        mask=np.concatenate([mask.T.ravel() for mask in masks]),
        mask_start=_starts(masks),
        edges=_joined(edges),
        edge_start=_starts(edges),
        observed=np.array([count_bits(mask) for mask in masks], dtype=np.int64),
        known=np.concatenate([words.T.ravel() for words in known]),
    )
    return Views(tuple(camera.name for camera in seen), arrays)


def _in_full_frame(observation: Observation, words: MaskWords) -> MaskWords:
    """A packed mask of an observation's region, extended to the full frame."""
    (width, height), (left, top) = observation.size_px, observation.offset_px
    if (observation.width, observation.height) == (width, height):
        return words
    frame = np.empty((height, (width + 63) // 64), dtype=np.uint64)
    paste_words(words, -left, -top, width, frame)
    return frame


def _edges(observation: Observation) -> NDArray[np.uint8]:
    """The edge map (h, w) of the full frame."""
    if observation.has_edges:
        return np.asarray(observation.in_full_frame(observation.edges))
    return _no_edges(observation.size_px)


@cache
def _no_edges(size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """An edge map (h, w) without edges; must not be changed."""
    return np.zeros(size_px[::-1], dtype=np.uint8)


def _joined(edges: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Edge maps of views, joined; not copied if no map has edges."""
    sizes = [edge.size for edge in edges]
    if all(edge is _no_edges(edge.shape[::-1]) for edge in edges):
        return _no_edges((sum(sizes), 1)).ravel()
    return np.concatenate([edge.ravel() for edge in edges])


def camera_arrays(cameras: Sequence[CameraModel]) -> ViewArrays:
    """The arrays of cameras without any evidence."""
    shared = _shared_arrays(tuple(cameras))
    # Copied, since fits of a calibration change them.
    return shared._replace(
        rotation=shared.rotation.copy(),
        translation=shared.translation.copy(),
        intrinsics=shared.intrinsics.copy(),
    )


@lru_cache(maxsize=_KEPT)
def _shared_arrays(cameras: tuple[CameraModel, ...]) -> ViewArrays:
    k = np.array([camera.matrix for camera in cameras])
    words, levels = np.empty(0, dtype=np.uint64), np.empty(0, dtype=np.uint8)
    none = np.zeros(len(cameras), dtype=np.int64)
    return ViewArrays(
        rotation=np.ascontiguousarray([camera.T_cam_world[:3, :3] for camera in cameras]),
        translation=np.ascontiguousarray([camera.T_cam_world[:3, 3] for camera in cameras]),
        intrinsics=np.stack([k[:, 0, 0], k[:, 0, 1], k[:, 0, 2], k[:, 1, 1], k[:, 1, 2]], axis=1),
        distortion=np.array([camera.distortion for camera in cameras]),
        size=np.array([camera.size_px for camera in cameras], dtype=np.int64),
        words=np.array([(camera.size_px[0] + 63) // 64 for camera in cameras], dtype=np.int64),
        mask=words,
        mask_start=none,
        edges=levels,
        edge_start=none,
        observed=none,
        known=words,
    )


def _starts(arrays: Sequence[NDArray[np.generic]]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([a.size for a in arrays])[:-1]]).astype(np.int64)


def _size(size_px: tuple[int, int]) -> str:
    return f"{size_px[0]}x{size_px[1]} px"
