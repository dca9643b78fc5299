"""One picture per frame and camera: the input, the evidence, the body over it."""

from collections.abc import Callable
from pathlib import Path

import cv2

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.datasets import FrameSet
from markerless_tracker.drawing import draw_evidence
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image, Segmenter
from markerless_tracker.records import Observation, TrackResult


class DebugImages:
    """Writes ``FOLDER/CAMERA/FFFFFF.jpg``, FFFFFF being the frame's number in its source.

    Raises:
        DatasetError: the folder cannot be made or a picture not written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DatasetError(f"{folder}: cannot be made: {error.strerror}") from error

    def write(
        self,
        images: FrameSet,
        result: TrackResult,
        rig: CameraRig,
        body: BodyModel,
        segmenter: Callable[[str], Segmenter | None] = lambda camera: None,
    ) -> None:
        """Write the pictures of one frame.

        Args:
            images: what the tracker saw.
            result: what it found.
            rig: its cameras.
            body: its body.
            segmenter: what segmented a camera's images, to show the steps before the silhouette.
        """
        for name, observation in result.observations.items():
            picture = draw_steps(
                images.images[name], observation, rig[name], body, result.pose, segmenter(name)
            )
            path = self.folder / name / f"{images.index:06d}.jpg"
            try:
                path.parent.mkdir(exist_ok=True)
            except OSError as error:
                raise DatasetError(f"{path.parent}: cannot be made: {error.strerror}") from error
            if not cv2.imwrite(str(path), picture):
                raise DatasetError(f"{path}: cannot be written")


def draw_steps(
    image: Image,
    observation: Observation,
    camera: CameraModel,
    body: BodyModel,
    pose: FloatArray | None,
    segmenter: Segmenter | None,
) -> Image:
    """All that was made of an image, side by side (h, 6 w, 3) BGR: see `draw_evidence`.

    Args:
        image: what the camera saw.
        observation: what the tracker used of it.
        camera: its camera.
        body, pose: what the tracker found, None if nobody.
        segmenter: what segmented the image; without one background and foreground are left out.

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
