"""Input, mask, edges and body of one image, side by side."""

import cv2
import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.drawing.overlay import Image, as_colour, draw_overlay
from markerless_tracker.errors import ImageError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

UNDECIDED_BGR = (0, 220, 255)
"""Colour of undecided pixels: yellow."""


def class_picture(observation: Observation) -> Image:
    """A picture (h, w, 3) BGR of the full frame: person white, undecided pixels as in the mask."""
    picture = np.zeros((observation.size_px[1], observation.size_px[0], 3), dtype=np.uint8)
    picture[observation.in_full_frame(observation.mask)] = 255
    if observation.undecided is not None:
        picture[observation.in_full_frame(observation.undecided)] = UNDECIDED_BGR
    return picture


def draw_evidence(
    image: Image,
    observation: Observation,
    camera: CameraModel,
    body: BodyModel | None = None,
    pose: FloatArray | None = None,
    *,
    background: Image | None = None,
    labels: Image | None = None,
) -> Image:
    """A picture (h, 4 w to 6 w, 3) BGR: the input, the mask, the edges, the body over the input.

    The background and the labels (h, w) from `Segmenter.labels` are the second and third panel if
    given. Undecided pixels of the mask are yellow. Pixels outside the observation's region are dark
    grey. Without a body or pose the last panel is the input.

    Raises:
        ImageError: image or observation does not fit the camera.
    """
    plain = as_colour(image, camera)
    if observation.size_px != camera.size_px:
        raise ImageError(
            f"{camera.name}: observation of a frame of {observation.size_px[0]}x"
            f"{observation.size_px[1]} px, expected {camera.size_px[0]}x{camera.size_px[1]}"
        )
    height, width = plain.shape[:2]
    u, v = observation.offset_px
    region = np.s_[v : v + observation.height, u : u + observation.width]
    mask = np.full((height, width), 64, dtype=np.uint8)
    edges = mask.copy()
    mask[region] = np.where(observation.mask, 255, 0)
    silhouette = cv2.cvtColor(mask, cv2.COLOR_GRAY2BGR)
    if observation.undecided is not None:
        silhouette[region][observation.undecided] = UNDECIDED_BGR
    edges[region] = observation.edges
    over = plain
    if body is not None and pose is not None:
        inside = np.zeros((height, width), dtype=np.bool_)
        inside[region] = observation.mask
        over = draw_overlay(image, camera, body, pose, mask=inside)
    panels = [
        plain,
        *(as_colour(shown, camera) for shown in (background, labels) if shown is not None),
        silhouette,
        cv2.cvtColor(edges, cv2.COLOR_GRAY2BGR),
        over,
    ]
    return np.ascontiguousarray(np.hstack(panels), dtype=np.uint8)
