"""Empty-scene images of a recording: its own, or learned from its frames."""

from collections.abc import Sequence
from pathlib import Path

from markerless_tracker.datasets.recording import Recording
from markerless_tracker.imaging import Image, background_plate

# Number of frames to learn from, evenly spread over the recording.
FRAMES = 36


def backgrounds_of(recording: Recording, folder: Path | None = None) -> dict[str, list[Image]]:
    """Camera name -> empty-scene images (scaled) of every camera of a recording.

    Images are read from `folder`, or from the recording's own `background/`; a camera with only a
    learned background there has the mean of that background. For a camera without any, an image is
    learned from the recording's stills of the room and its frames; a warning of the recording
    states the source and its limits. The same frames give the same image in every format.

    Raises:
        DatasetError, ImageError: the images cannot be read.
    """
    found = {
        name: [model.image] for name, model in recording.background_models(folder).items()
    } | recording.background_frames(folder)
    missing = [name for name in recording.rig.names if name not in found]
    if not missing:
        return found
    clips = _clips(recording, missing)
    stills = recording.room_stills()
    for name in missing:
        plate = background_plate([clips[name]], stills.get(name, []), camera=name)
        recording.warn(f"{name}: no empty-scene image, background learned from {plate.note}")
        found[name] = [plate.image]
    return {name: found[name] for name in recording.rig.names}


def _clips(recording: Recording, names: Sequence[str]) -> dict[str, list[Image]]:
    """Camera name -> images, evenly spread over the whole recording, fewer than `2 * FRAMES`."""
    recording = recording.source
    every = max(1, (recording.frame_count or 1) // FRAMES)
    clips: dict[str, list[Image]] = {name: [] for name in names}
    kept, step = 0, 1  # step doubles while a recording of unknown length is read
    for number, frame in enumerate(recording.frames(every=every)):
        if recording.frame_count is None and number % step:
            continue
        for name in names:
            clips[name].append(frame.images[name])
        kept += 1
        if recording.frame_count is None and kept == 2 * FRAMES:
            clips = {name: images[::2] for name, images in clips.items()}
            kept, step = FRAMES, 2 * step
    return clips
