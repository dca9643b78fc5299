"""Input of the silhouette benchmark: frames with exact masks, or with a reference pose."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import (
    BodyModel,
    load_body,
    load_description,
    pose_from_markers,
    subject_from_markers,
)
from markerless_tracker.body.build import build_body
from markerless_tracker.body.start import POSE_MARKERS
from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import Recording, open_recording, read_trc, truth_path
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.drawing import silhouette
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.setup import first_row

Mask = NDArray[np.bool_]

BODY = "person31"
FRAMES = 10
"""Number of frames measured of a synthetic scene, and of a recording without exact masks."""
_EMPTY_IMAGES = 10


@dataclass(frozen=True, eq=False)
class ImageSet:
    """Images of one frame, with its exact masks or reference pose.

    Attributes:
        index: index of the frame.
        images: camera -> image.
        exact: camera -> exact mask (h, w); empty without any.
        body: the body.
        pose: its reference pose (p,); None if unknown.
    """

    index: int
    images: Mapping[str, Image]
    exact: Mapping[str, Mask]
    body: BodyModel
    pose: FloatArray | None = None

    def masks(self, rig: CameraRig) -> Mapping[str, Mask]:
        """Camera -> mask (h, w) to compare with: exact, or of the body at the reference pose."""
        if self.exact or self.pose is None:
            return self.exact
        return {camera.name: silhouette(self.body, self.pose, camera) for camera in rig}


@dataclass(frozen=True, eq=False)
class SilhouetteScene:
    """A recording or a synthetic scene, as input of the benchmark.

    Attributes:
        name: name of the recording.
        rig: its cameras.
        empty: empty-scene images by camera.
        indices: indices of the measured frames.
        exact: whether there are exact masks.
        body: the body whose silhouette replaces exact masks.
        frames: yields the measured sets in order.
    """

    name: str
    rig: CameraRig
    empty: Mapping[str, list[Image]]
    indices: tuple[int, ...]
    exact: bool
    body: BodyModel
    frames: Callable[[], Iterator[ImageSet]]

    @property
    def frame_count(self) -> int:
        """Number of frames measured."""
        return len(self.indices)


def recorded_scene(
    source: Path, *, scale: float = 1.0, frames: int | None = None
) -> SilhouetteScene:
    """A recording with exact masks, or with a `ground_truth.trc` for the reference pose.

    Args:
        source: the recording.
        scale: factor for its images.
        frames: at most this many frames, evenly spaced; None = all with exact masks, or `FRAMES` of
            those with markers.

    Raises:
        TrackerError: it has neither, or cannot be read.
    """
    recording = open_recording(source, scale=scale)
    exact = {name: found for name in recording.rig.names if (found := recording.masks(name))}
    poses: dict[int, FloatArray] = {}
    truth = truth_path(source)
    if exact:
        body = load_body(BODY)
        known = sorted(set().union(*exact.values()))
        if truth.is_file():
            body, poses = _posed(recording, truth)
    else:
        if not truth.is_file():
            raise DatasetError(f"{source}: neither masks/ nor {truth.name}, expected one of them")
        body, poses = _posed(recording, truth)
        known = sorted(poses)
        frames = frames or FRAMES
    count = recording.frame_count
    known = [index for index in known if count is None or index < count]
    if not known:
        raise DatasetError(f"{source}: no frame in which the body is known, expected at least one")
    if frames is not None and frames < len(known):
        known = [known[int(i)] for i in np.linspace(0, len(known) - 1, frames).round()]
    chosen = set(known)

    def read() -> Iterator[ImageSet]:
        for views in recording.frames():
            if views.index in chosen:
                masks = {
                    name: found[views.index] > 0
                    for name, found in exact.items()
                    if views.index in found
                }
                yield ImageSet(views.index, views.images, masks, body, poses.get(views.index))
            if views.index >= known[-1]:
                return

    return SilhouetteScene(
        recording.name,
        recording.rig,
        backgrounds_of(recording),
        tuple(known),
        bool(exact),
        body,
        read,
    )


def made_up_scene(
    *, frames: int = FRAMES, size_px: tuple[int, int] = (656, 490), grey: bool = False
) -> SilhouetteScene:
    """A synthetic walk in front of four cameras, every sixth frame of it."""
    scene = SyntheticScene(body=BODY, size_px=size_px, grey=grey)
    indices = tuple(6 * i for i in range(frames))

    def make() -> Iterator[ImageSet]:
        for index in indices:
            images, masks, pose = scene.frame(index)
            yield ImageSet(index, images, masks, scene.body, pose)

    empty = scene.backgrounds(_EMPTY_IMAGES)
    return SilhouetteScene("made up", scene.rig, empty, indices, True, scene.body, make)


def _posed(recording: Recording, truth: Path) -> tuple[BodyModel, dict[int, FloatArray]]:
    """The body with lengths from the first row of markers, and its pose (p,) by frame.

    Raises:
        DatasetError: the file lacks a marker that every pose needs.
        TrackerError: it cannot be read, or does not give the lengths.
    """
    track = read_trc(truth).with_pelvis()
    missing = [name for name in POSE_MARKERS if name not in track.names]
    if missing:
        raise DatasetError(
            f"{truth}: no marker {', '.join(missing)}, expected {', '.join(POSE_MARKERS)} for the "
            "reference poses"
        )
    description = load_description(BODY)
    row = first_row(truth)
    body = build_body(description, subject_from_markers(description, row.markers_m))
    poses = {}
    for stamp_ns, positions in zip(track.stamps_ns.tolist(), track.positions_m, strict=True):
        named = dict(zip(track.names, positions, strict=True))
        if not all(np.isfinite(named[name]).all() for name in POSE_MARKERS):
            continue
        try:
            index = recording.start_index(stamp_ns)
        except DatasetError:
            continue
        poses[index] = pose_from_markers(body, named)
    return body, poses
