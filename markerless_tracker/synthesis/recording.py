"""A scene as files: the neutral layout of a recording, without its marker file."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import cv2

from markerless_tracker.body import Subject, write_pose, write_subject
from markerless_tracker.camera import write_calibration
from markerless_tracker.errors import DatasetError
from markerless_tracker.synthesis.render import Image
from markerless_tracker.synthesis.scene import SyntheticScene

LOSSY, LOSSLESS = (".mp4", "mp4v"), (".mkv", "FFV1")
"""Suffix and code of the videos' format."""
EMPTY_FRAMES = 30
_SUBJECT, _START = "subject.yaml", "start.yaml"


def write_recording(
    scene: SyntheticScene,
    folder: Path,
    *,
    frames: int,
    mask_every: int = 50,
    lossless: bool = False,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Write a scene's first frames into an existing folder.

    Written: `calibration.toml`, `camNN.mp4` (`.mkv` if lossless: some 0.6 MB per image of 656x490),
    `background/camNN.*` with empty frames, `masks/camNN/FFFFFF.png` for every `mask_every`-th
    frame, `subject.yaml` and `start.yaml` (the true pose of frame 0).

    Args:
        scene: what to write; it names the frame rate.
        folder: an empty folder.
        frames: number of frames.
        mask_every: distance of the frames with exact masks.
        lossless: keep every grey level instead of compressing as ordinary cameras do.
        progress: called with the number of frames written so far.

    Raises:
        DatasetError: a video cannot be written, a compressed one of odd size included.
    """
    suffix, code = LOSSLESS if lossless else LOSSY
    for camera in scene.rig:
        if not lossless and (camera.size_px[0] % 2 or camera.size_px[1] % 2):
            raise DatasetError(
                f"{camera.name}: size {camera.size_px[0]}x{camera.size_px[1]}, "
                "expected even numbers for compressed video"
            )
        (folder / "masks" / camera.name).mkdir(parents=True)
    (folder / "background").mkdir()
    write_calibration(folder / "calibration.toml", scene.rig)
    write_subject(folder / _SUBJECT, Subject("made up", scene.body.lengths_m))
    write_pose(folder / _START, scene.body, scene.pose(0))

    empty = scene.backgrounds(EMPTY_FRAMES)
    with _videos(scene, folder / "background", suffix, code) as write:
        for i in range(EMPTY_FRAMES):
            write({name: images[i] for name, images in empty.items()})
    with _videos(scene, folder, suffix, code) as write:
        for index in range(frames):
            images, masks, _ = scene.frame(index)
            write(images)
            if index % mask_every == 0:
                for name, mask in masks.items():
                    _write_image(
                        folder / "masks" / name / f"{index:06d}.png", mask.astype("u1") * 255
                    )
            if progress is not None:
                progress(index + 1)


@contextmanager
def _videos(
    scene: SyntheticScene, folder: Path, suffix: str, code: str
) -> Iterator[Callable[[Mapping[str, Image]], None]]:
    """One video per camera; yields a function that appends one image to each."""
    writers: dict[str, cv2.VideoWriter] = {}
    try:
        for camera in scene.rig:
            path = folder / f"{camera.name}{suffix}"
            fourcc = cv2.VideoWriter.fourcc(*code)
            writer = cv2.VideoWriter(str(path), fourcc, scene.fps, camera.size_px)
            writers[camera.name] = writer
            if not writer.isOpened():
                raise DatasetError(f"{path}: OpenCV cannot write {code} video")

        def write(images: Mapping[str, Image]) -> None:
            for name, writer in writers.items():
                writer.write(images[name])

        yield write
    finally:
        for writer in writers.values():
            writer.release()


def _write_image(path: Path, image: Image) -> None:
    if not cv2.imwrite(str(path), image):
        raise DatasetError(f"{path}: cannot be written")
