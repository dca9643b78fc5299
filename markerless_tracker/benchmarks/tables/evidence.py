"""A recording's evidence, computed once and shared by many runs, also in other processes.

Decoding and segmentation do not depend on body, seed or search. The observations that
`Tracker.step` would make are written to plain files, which the runs map into memory. A run on them
gives the same numbers as a run on the images.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets import FrameSet, Recording, open_recording
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import ImagingSettings, Segmenter
from markerless_tracker.records import Observation, locked
from markerless_tracker.results.run import recording_backgrounds

_KINDS = ("mask", "undecided", "edges")


@dataclass(frozen=True, eq=False)
class Evidence:
    """Observations of one recording under one set of imaging settings.

    Attributes:
        folder: folder of the files; the caller of `make_evidence` removes it.
        rig: the cameras, scaled as the images were.
        every: frames of the recording from one stored set to the next.
        stamps_ns: one per stored set.
    """

    folder: Path
    rig: CameraRig
    every: int
    stamps_ns: tuple[int, ...]

    def frames(self, *, every: int) -> Iterator[tuple[int, dict[str, Observation]]]:
        """Stamp (ns) and observations by camera, of every `every`-th frame of the recording.

        Raises:
            DatasetError: `every` is no multiple of what is stored.
        """
        if every < 1 or every % self.every:
            raise DatasetError(
                f"every {every}th frame requested, expected a multiple of {self.every}"
            )
        count = len(self.stamps_ns)
        masks, undecided, edges = {}, {}, {}
        for camera in self.rig:
            width, height = camera.size_px
            mask, unsure, edge = _files(self.folder, camera.name)
            words = (count, height, (width + 63) // 64)
            masks[camera.name] = np.memmap(mask, np.uint64, "r", shape=words)
            undecided[camera.name] = np.memmap(unsure, np.uint64, "r", shape=words)
            edges[camera.name] = np.memmap(edge, np.uint8, "r", shape=(count, height, width))
        for row in range(0, count, every // self.every):
            stamp_ns = self.stamps_ns[row]
            yield (
                stamp_ns,
                {
                    camera.name: Observation(
                        camera.name,
                        stamp_ns,
                        camera.size_px,
                        (0, 0),
                        locked(np.asarray(masks[camera.name][row]), np.uint64),
                        locked(np.asarray(edges[camera.name][row]), np.uint8),
                        locked(np.asarray(undecided[camera.name][row]), np.uint64),
                    )
                    for camera in self.rig
                },
            )


@dataclass(frozen=True)
class EvidenceOrder:
    """Arguments of `make_evidence` as a value that can be sent to another machine.

    Attributes:
        source: the recording.
        scale: factor for its images.
        settings: settings of the imaging.
        start, every, frames: as for `make_evidence`.
        key: of the recording, which distinguishes its states.
    """

    source: Path
    scale: float
    settings: ImagingSettings
    start: int
    every: int
    frames: int | None
    key: str

    def make(
        self,
        folder: Path,
        *,
        recording: Recording | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Evidence:
        """Make the evidence in an existing, empty folder; opens the recording unless it is given.

        Raises:
            TrackerError: as `make_evidence`, or the recording does not exist.
        """
        return make_evidence(
            recording or open_recording(self.source, scale=self.scale),
            self.settings,
            folder,
            start=self.start,
            every=self.every,
            frames=self.frames,
            progress=progress,
        )


def make_evidence(
    recording: Recording,
    settings: ImagingSettings,
    folder: Path,
    *,
    start: int = 0,
    every: int = 1,
    frames: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Evidence:
    """Segment a recording into a folder (1.25 bytes per pixel, camera and frame).

    Args:
        recording: the images.
        settings: settings of the imaging.
        folder: an existing, empty folder.
        start: first frame.
        every: keep every k-th frame from there on.
        frames: use this many frames of the recording at most, counted before `every`.
        progress: called with the number of sets stored so far.

    Raises:
        TrackerError: the recording cannot be read, or an image does not fit its background.
    """
    backgrounds = recording_backgrounds(recording, settings)
    segmenters = {name: Segmenter(name, backgrounds[name], settings) for name in backgrounds}
    stamps: list[int] = []
    with ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(max_workers=len(segmenters)))
        files = {
            name: tuple(stack.enter_context(path.open("wb")) for path in _files(folder, name))
            for name in segmenters
        }

        def observe(item: tuple[str, FrameSet]) -> None:
            name, views = item
            observation = segmenters[name].observe(views.images[name], views.stamp_ns)
            mask, undecided, edges = files[name]
            mask.write(observation.mask_words.tobytes())
            words = observation.undecided_words
            words = np.zeros_like(observation.mask_words) if words is None else words
            undecided.write(words.tobytes())
            edges.write(observation.edges.tobytes())

        for views in recording.frames(start=start, every=every):
            if frames is not None and views.index - start >= frames:
                break
            list(pool.map(observe, [(name, views) for name in segmenters]))
            stamps.append(views.stamp_ns)
            if progress is not None:
                progress(len(stamps))
    return Evidence(folder, recording.rig, every, tuple(stamps))


def _files(folder: Path, camera: str) -> tuple[Path, Path, Path]:
    """Files of the person, of the undecided pixels, and of the edges."""
    mask, undecided, edges = (folder / f"{camera}.{kind}" for kind in _KINDS)
    return mask, undecided, edges
