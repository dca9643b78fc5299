"""The floor test: an undecided pixel is no shadow if other cameras see its floor point lit.

A shadow lies on the floor, the plane z = 0 of the calibrated world. The floor point behind a shadow
pixel is darkened in every camera that sees it. The floor point behind a pixel of the person is seen
elsewhere in the other images, and is mostly lit there.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel
from markerless_tracker.camera.lens import pixel, without_lens
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.mask_words import has
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import MaskWords, Observation, locked

TESTED_RADIUS_M = 3.0
"""Floor points farther than this from the person are not tested: they may lie behind a wall."""
PENUMBRA_PX = 2
"""Background this near to person or undecided pixels may be half in shadow, so it is not lit."""


class FloorView(NamedTuple):
    """What a camera shows of the floor, in a window of its frame.

    Attributes:
        camera: its model.
        offset_px: (u, v) of the window's top left pixel.
        width: of the window, px.
        person: (h, ceil(w / 64)) silhouette, packed as by `pack_mask`.
        undecided: pixels that may be shadow, packed likewise.
        hidden: pixels of the body or of the hull, packed likewise; they show no floor.
    """

    camera: CameraModel
    offset_px: tuple[int, int]
    width: int
    person: MaskWords
    undecided: MaskWords
    hidden: MaskWords

    @classmethod
    def of(cls, seen: Observation, camera: CameraModel, hidden: MaskWords) -> "FloorView":
        """That of an observation; `hidden` is of its region."""
        undecided = seen.undecided_words
        if undecided is None:
            undecided = locked(np.zeros_like(seen.mask_words), np.uint64)
        return cls(camera, seen.offset_px, seen.width, seen.mask_words, undecided, hidden)


def floor_points(pixels: FloatArray, camera: CameraModel) -> FloatArray:
    """Points (n, 3) m where the rays of pixels (n, 2) meet the floor; NaN where they do not."""
    points = np.empty((len(pixels), 3))
    _meet_floor(pixels, camera.matrix, camera.distortion, camera.T_world_cam, points)
    return points


def lit_elsewhere(points: FloatArray, others: Iterable[FloorView]) -> NDArray[np.bool_]:
    """Which floor points (n, 3) m some camera sees lit and no camera sees darkened; False for NaN.

    A pixel is lit if neither it nor any pixel within `PENUMBRA_PX` is person or undecided. It is
    darkened if it is undecided.
    """
    lit, dark = np.zeros((2, len(points)), dtype=np.bool_)
    for view in others:
        camera = view.camera
        _look(
            points, camera.T_cam_world, camera.matrix, camera.distortion, view.offset_px,
            view.width, view.person, view.undecided, view.hidden, lit, dark,
        )  # fmt: skip
    return lit & ~dark


@kernel
def _meet_floor(pixels, matrix, distortion, placed, points):  # type: ignore[no-untyped-def]
    """Fill points (n, 3) as `floor_points`; placed (4, 4): camera to world."""
    for i in range(pixels.shape[0]):
        b = (pixels[i, 1] - matrix[1, 2]) / matrix[1, 1]
        a = (pixels[i, 0] - matrix[0, 2] - matrix[0, 1] * b) / matrix[0, 0]
        a, b = without_lens(a, b, distortion)
        down = placed[2, 0] * a + placed[2, 1] * b + placed[2, 2]
        # A ray that points away from the floor does not meet it.
        along = -placed[2, 3] / down if down * placed[2, 3] < 0.0 else np.nan
        for k in range(3):
            ray = placed[k, 0] * a + placed[k, 1] * b + placed[k, 2]
            points[i, k] = placed[k, 3] + along * ray


@kernel
def _look(  # type: ignore[no-untyped-def]
    points, to_camera, matrix, distortion, offset, width, person, undecided, hidden, lit, dark
):
    """Mark the points (n, 3) that a view shows lit (in `lit`) or darkened (in `dark`)."""
    height = person.shape[0]
    for i in range(points.shape[0]):
        u, v = pixel(points[i, 0], points[i, 1], points[i, 2], to_camera, matrix, distortion)
        u, v = u - offset[0], v - offset[1]
        # NaN fails the comparison and is left out, too.
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, row = np.int64(u), np.int64(v)
        if has(hidden, column, row):
            continue
        if has(undecided, column, row):
            dark[i] = True
        elif not _near_any(person, undecided, column, row, width):
            lit[i] = True


@kernel
def _near_any(person, undecided, u, v, width):  # type: ignore[no-untyped-def]
    """Whether a pixel within `PENUMBRA_PX` is person or undecided."""
    for row in range(max(0, v - PENUMBRA_PX), min(person.shape[0], v + PENUMBRA_PX + 1)):
        for column in range(max(0, u - PENUMBRA_PX), min(width, u + PENUMBRA_PX + 1)):
            if has(person, column, row) or has(undecided, column, row):
                return True
    return False
