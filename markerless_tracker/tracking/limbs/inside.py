"""Fractions of the limbs that lie inside the silhouettes, which tell a lost limb."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.body.parts import cones_of
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.lens import projected
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.raster.mask_words import has
from markerless_tracker.geometry import FloatArray
from markerless_tracker.observation import locked
from markerless_tracker.records import Observation

_NONE = locked(np.empty((0, 0), dtype=np.uint64), np.uint64)
_ALONG = np.linspace(0.1, 0.9, 5)
"""Points along each cone's axis that `inside_fractions` tests, as fractions of its length."""


def inside_fractions(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> dict[str, float]:
    """Fraction of each limb's cone axes inside the silhouettes, mean over the views.

    Points outside of a view's region count as outside of its silhouette. Points outside of its
    frame, or on undecided pixels, do not count.
    """
    placed = cone_transforms(body, pose)
    along = (body.cone_length[:, None] * _ALONG)[:, :, None]
    points = (placed[:, None, :, 3] + along * placed[:, None, :, 2]).reshape(-1, 3)
    seen = [_located(points, observation, rig) for observation in observations.values()]
    fractions = {}
    for name in body.limbs:
        own = np.repeat(cones_of(body, name), _ALONG.size)
        values = [
            float(inside[own].sum()) / float(framed[own].sum())
            for framed, inside in seen
            if framed[own].any()
        ]
        if values:
            fractions[name] = float(np.mean(values))
    return fractions


def _located(
    points: FloatArray, observation: Observation, rig: CameraRig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the points (n, 3) lie in a view's frame, and which in its silhouette."""
    camera = rig[observation.camera]
    undecided = observation.undecided_words
    framed, inside = np.zeros((2, len(points)), dtype=np.bool_)
    _find(
        points, camera.T_cam_world, camera.matrix, camera.distortion, observation.size_px,
        observation.offset_px, (observation.width, observation.height), observation.mask_words,
        _NONE if undecided is None else undecided,
        framed, inside,
    )  # fmt: skip
    return framed, inside


@kernel
def _find(  # type: ignore[no-untyped-def]
    points, to_camera, matrix, distortion, size, offset, region, mask, undecided, framed, inside
):
    for i in range(points.shape[0]):
        u, v = projected(points[i, 0], points[i, 1], points[i, 2], to_camera, matrix, distortion)
        # NaN fails the comparison and is left out, too.
        if not (u >= 0.0 and v >= 0.0 and u <= size[0] - 1.0 and v <= size[1] - 1.0):
            continue
        framed[i] = True
        column, row = np.int64(np.rint(u)) - offset[0], np.int64(np.rint(v)) - offset[1]
        if column < 0 or row < 0 or column >= region[0] or row >= region[1]:
            continue
        inside[i] = has(mask, column, row)
        if undecided.size > 0 and has(undecided, column, row):
            framed[i] = False
