"""Input of the speed measurement: a few frames in memory, with markers for the start pose."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from markerless_tracker.body import (
    MARKER_NAMES,
    BodyModel,
    load_description,
    pose_from_markers,
    subject_from_markers,
)
from markerless_tracker.body.build import build_body
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import FrameSet, existing_truth, open_recording
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.setup import first_row

SIZE_PX = (644, 488)
"""Image size of the synthetic scene: width, height."""
_EMPTY_IMAGES = 5


@dataclass(frozen=True, eq=False)
class SpeedScene:
    """Frames of a recording, in memory.

    Attributes:
        name: name of the recording.
        rig: its cameras.
        frames: the frame sets in order.
        empty: empty-scene images by camera.
        markers_m: markers (3,) of the first frame by name, m, world frame.
    """

    name: str
    rig: CameraRig
    frames: tuple[FrameSet, ...]
    empty: Mapping[str, list[Image]]
    markers_m: Mapping[str, FloatArray]

    def body(self, name: str) -> BodyModel:
        """A body with segment lengths from the markers of the first frame."""
        description = load_description(name)
        return build_body(description, subject_from_markers(description, self.markers_m))

    def pose(self, body: BodyModel) -> FloatArray:
        """The pose (p,) fitted to the markers of the first frame."""
        return pose_from_markers(body, self.markers_m)


def recorded_scene(source: Path, *, frames: int, scale: float = 1.0) -> SpeedScene:
    """Frames of a recording, from the first row of its `ground_truth.trc` on.

    Args:
        source: the recording.
        frames: number of frames at most.
        scale: factor for the images.

    Raises:
        TrackerError: the recording cannot be read, has no `ground_truth.trc`, or ends before the
            second frame.
    """
    recording = open_recording(source, scale=scale)
    row = first_row(existing_truth(source))
    sets = []
    for images in recording.frames(start=recording.start_index(row.stamp_ns)):
        sets.append(images)
        if len(sets) == frames:
            break
    if len(sets) < 2:
        raise DatasetError(f"{source}: {len(sets)} frame from the start on, expected at least 2")
    return SpeedScene(
        recording.name, recording.rig, tuple(sets), backgrounds_of(recording), row.markers_m
    )


def made_up_scene(*, frames: int, size_px: tuple[int, int] = SIZE_PX) -> SpeedScene:
    """A synthetic walk in front of four cameras."""
    scene = SyntheticScene(body="person31", size_px=size_px)
    sets = tuple(FrameSet(i, scene.stamp_ns(i), scene.frame(i)[0]) for i in range(frames))
    markers_m = dict(zip(MARKER_NAMES, scene.markers(0), strict=True))
    return SpeedScene("made up", scene.rig, sets, scene.backgrounds(_EMPTY_IMAGES), markers_m)
