"""Silhouettes made elsewhere, as images on disk: `DIR/CAMERA/FRAME.png`."""

from collections.abc import Iterator
from pathlib import Path
from typing import cast

from markerless_tracker.datasets.recording import DerivedRecording, FrameSet, Recording
from markerless_tracker.datasets.video.masks import masks_by_frame, read_mask
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image
from markerless_tracker.observation import Observation, no_edges


class SilhouetteRecording(DerivedRecording):
    """A recording whose sets hold observations, which `Tracker.step` takes in place of images.

    A folder per camera has an image per frame: person from 128 on, background below. Files are
    named by the number of their frame as the camera stored it, such as 000050.png; images of
    another size than the recording's are scaled. A camera without a file for a frame is missing in
    its set; frames of which no camera has a file are left out, with a warning.

    Args:
        recording: the recording, for its stamps.
        folder: holds a folder for every camera.

    Raises:
        DatasetError: a camera has no folder, a file's name is no number, or (from `frames`) none of
            the frames read has a file.
    """

    def __init__(self, recording: Recording, folder: Path) -> None:
        super().__init__(recording)
        self._folder, rig = folder, recording.rig
        missing = [name for name in rig.names if not (folder / name).is_dir()]
        if missing:
            raise DatasetError(
                f"{folder}: no folder {', '.join(missing)}, expected one of silhouettes per camera"
            )
        self._files: dict[str, dict[int, Path]] = {}
        for name in rig.names:
            self._files[name] = masks_by_frame(folder / name)

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        left_out = read = first = 0
        for frame in self._inner.frames(start=start, every=every):
            first = frame.index if read == 0 else first
            views = self._views(frame.index, frame.stamp_ns)
            read += 1
            if views:
                # The type of a set knows images only; the tracker takes both.
                yield FrameSet(frame.index, frame.stamp_ns, cast("dict[str, Image]", views))
            else:
                left_out += 1
        if read and left_out == read:
            name = self.rig.names[0]
            raise DatasetError(
                f"{self._folder}: no silhouette of any of the {read} frames read, expected files "
                f"such as {name}/{self.stored_index(name, first):06d}.png"
            )
        if left_out:
            self.warn(
                f"{self.name}: {left_out} of {read} frames left out, no camera has a silhouette",
                replaces="left out",
            )

    def _views(self, index: int, stamp_ns: int) -> dict[str, Observation]:
        """Observations of the cameras that have a silhouette of a frame, without edges."""
        found = {}
        for camera in self.rig:
            file = self._files[camera.name].get(self.stored_index(camera.name, index))
            if file is not None:
                mask = read_mask(file, camera.size_px) > 0
                edges = no_edges((mask.shape[0], mask.shape[1]))
                found[camera.name] = Observation.from_mask(camera.name, stamp_ns, mask, edges)
        return found
