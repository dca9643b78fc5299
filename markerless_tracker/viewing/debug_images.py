"""One picture per frame and camera: the input, the evidence, the body over the input."""

from collections.abc import Callable
from pathlib import Path

import cv2

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import FrameSet
from markerless_tracker.drawing.steps import draw_steps
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Segmenter
from markerless_tracker.records import TrackResult


class DebugImages:
    """Writes ``FOLDER/CAMERA/FFFFFF.jpg``; FFFFFF is the frame's number in its source.

    Raises:
        DatasetError: the folder cannot be made, or a picture cannot be written.
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
            images: the images of the frame.
            result: the tracker's result.
            rig: the tracker's cameras.
            body: the tracked body.
            segmenter: returns the segmenter of a camera, None = without its background and labels.
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
