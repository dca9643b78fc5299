"""The pixels that a posed body covers, drawn by the kernels of the fitness."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.arrays import body_arrays, camera_arrays
from markerless_tracker.fitness.raster.fill import clear_used, fill_outline
from markerless_tracker.fitness.raster.kernels import cone_ends
from markerless_tracker.fitness.raster.outline import find_outlines
from markerless_tracker.fitness.raster.outline_arrays import (
    HIDDEN,
    LANES,
    make_outlines,
    outlines_of,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords, unpack_mask


def body_masks(
    body: BodyModel, pose: FloatArray, cameras: Sequence[CameraModel]
) -> dict[str, NDArray[np.bool_]]:
    """By camera, the mask (h, w) of the pixels whose centres a body at a pose (p,) covers."""
    packed = body_words(body, pose, cameras)
    return {camera.name: unpack_mask(packed[camera.name], camera.size_px[0]) for camera in cameras}


def body_words(
    body: BodyModel, pose: FloatArray, cameras: Sequence[CameraModel]
) -> dict[str, MaskWords]:
    """As `body_masks`, packed as `pack_mask` does."""
    views = camera_arrays(cameras)
    arrays = body_arrays(body)
    height = int(views.size[:, 1].max())
    outlines = make_outlines(1, height)
    world = np.ones(18 * LANES)
    # Copied, since a read-only pose would make numba compile the kernel once more.
    cone_ends(np.array(pose), arrays, np.empty((body.node_parent.size, 3, 4)), world)
    packed = {}
    for view, camera in enumerate(cameras):
        height, words = camera.size_px[1], int(views.words[view])
        bits = np.zeros(words * height, dtype=np.uint64)
        used = np.empty((words, 2), dtype=np.int64)
        _fill(view, views, len(body.cone_names), world, outlines, bits, used)
        packed[camera.name] = np.ascontiguousarray(bits.reshape(words, height).T)
    return packed


@kernel
def _fill(view, views, cones, world, outlines, bits, used):  # type: ignore[no-untyped-def]
    width, height = views.size[view, 0], views.size[view, 1]
    out = outlines_of(outlines, 0)
    count = find_outlines(cones, views, view, world, out)
    clear_used(views.words[view], height, used)
    for c in range(cones):
        if out.form[c] != HIDDEN:
            fill_outline(c, count, out, width, height, bits, used)
