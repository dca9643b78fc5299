"""All steps from an image to the body in one picture."""

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.drawing.evidence import draw_evidence
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image, Segmenter
from markerless_tracker.records import Observation


def draw_steps(
    image: Image,
    observation: Observation,
    camera: CameraModel,
    body: BodyModel,
    pose: FloatArray | None,
    segmenter: Segmenter | None,
) -> Image:
    """The steps side by side (h, 6 w, 3) BGR, (h, 4 w, 3) without a segmenter; see `draw_evidence`.

    Args:
        image: the input image.
        observation: the evidence that the tracker used.
        camera: its camera.
        body, pose: the tracked body and its pose (p,), None without an estimate.
        segmenter: the camera's segmenter; without it background and labels are left out.

    Raises:
        ImageError: image or observation does not fit the camera.
    """
    return draw_evidence(
        image,
        observation,
        camera,
        body,
        pose,
        background=None if segmenter is None else segmenter.background.image,
        labels=None if segmenter is None else segmenter.labels(image),
    )
