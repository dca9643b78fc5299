"""Runs a tracker over a recording, through the same `Tracker.step` as the live node."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from markerless_tracker.datasets import FrameSet, Recording, every_for_fps
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.imaging import BackgroundModel, ImagingSettings, learn_background
from markerless_tracker.libraries import usable_cores
from markerless_tracker.records import TrackResult
from markerless_tracker.tracking import Prepared, TrackerSetup


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """A set of images and its result."""

    images: FrameSet
    result: TrackResult


def recording_backgrounds(
    recording: Recording, settings: ImagingSettings, folder: Path | None = None
) -> dict[str, BackgroundModel]:
    """Background models of all cameras, from a folder or the recording's own images.

    Learned models (`NAME.npz`) take precedence over images.

    Raises:
        DatasetError, ImageError: a background file cannot be used.
    """
    models = recording.background_models(folder)
    if len(models) == len(recording.rig):
        return models
    return {
        name: models.get(name) or learn_background(frames, settings, camera=name)
        for name, frames in backgrounds_of(recording, folder).items()
    }


def frames_to_track(recording: Recording, setup: TrackerSetup, fps: float | None) -> int | None:
    """Number of the frames that `track_recording` yields; None if it is unknown."""
    if recording.frame_count is None:
        return None
    start = 0 if setup.start_stamp_ns is None else recording.start_index(setup.start_stamp_ns)
    return -(-(recording.frame_count - start) // every_for_fps(recording.fps, fps))


def track_recording(
    recording: Recording, setup: TrackerSetup, *, fps: float | None = None
) -> Iterator[TrackedFrame]:
    """Track from the start's frame (the first, if the start names no time) to the end.

    With more than one thread the next set is read and its evidence made while a set is fitted;
    results are the same bytes.

    Args:
        recording: images, at the scale of the tracker's rig.
        setup: the tracker and the time of its start pose.
        fps: keep every k-th frame from the start frame on; None = all.

    Raises:
        ConfigError: the recording's rate is no multiple of `fps`.
        DatasetError: no frame at the start's time, or the source is unreadable.
    """
    every = every_for_fps(recording.fps, fps)
    start = 0 if setup.start_stamp_ns is None else recording.start_index(setup.start_stamp_ns)
    frames = recording.frames(start=start, every=every)
    tracker = setup.tracker
    if (tracker.config.threads or usable_cores()) == 1:
        for images in frames:
            yield TrackedFrame(images, tracker.step(images.images, images.stamp_ns))
        return

    def read() -> tuple[FrameSet, Prepared] | None:
        images = next(frames, None)
        if images is None:
            return None
        return images, tracker.prepare(images.images, images.stamp_ns)

    with ThreadPoolExecutor(1, thread_name_prefix="evidence") as ahead:
        current = ahead.submit(read).result()
        while current is not None:
            images, prepared = current
            following = ahead.submit(read)
            result = tracker.step(prepared, images.stamp_ns)
            # What the caller does with a result may use the tracker.
            wait([following])
            yield TrackedFrame(images, result)
            current = following.result()
