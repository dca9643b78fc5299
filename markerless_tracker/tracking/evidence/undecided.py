"""Undecided pixels near the predicted body become person; the others stay undecided."""

from collections.abc import Mapping

import cv2
import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

NEAR_PX = 1
"""Undecided pixels so near to the body belong to the person."""


def decide(
    observed: Mapping[str, Observation],
    cameras: Mapping[str, CameraModel],
    body: BodyModel,
    pose: FloatArray,
) -> dict[str, Observation]:
    """Observations whose undecided pixels near a body at a pose (p,) are person.

    The pose is a prior of the segmentation, after PoseCut (Bray, Kohli and Torr 2006).
    """
    open_ = [name for name, seen in observed.items() if seen.undecided_words is not None]
    if not open_:
        return dict(observed)
    bodies = body_masks(body, pose, [cameras[name] for name in open_])
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * NEAR_PX + 1, 2 * NEAR_PX + 1))
    decided = dict(observed)
    for name in open_:
        seen = observed[name]
        undecided = seen.undecided
        assert undecided is not None
        u, v = seen.offset_px
        window = bodies[name][v : v + seen.height, u : u + seen.width].view(np.uint8)
        near = cv2.dilate(np.ascontiguousarray(window), disc).view(np.bool_)
        decided[name] = seen.with_masks(seen.mask | (undecided & near), undecided & ~near)
    return decided
