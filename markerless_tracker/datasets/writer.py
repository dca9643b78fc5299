"""Writing recording folders: videos, masks, background, calibration, reference markers."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2

from markerless_tracker.camera import CameraModel, CameraRig, write_calibration
from markerless_tracker.datasets.folder import CALIBRATION
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.markers.trc import write_trc
from markerless_tracker.datasets.recording import BACKGROUND
from markerless_tracker.datasets.target import new_folder
from markerless_tracker.datasets.truth import truth_path
from markerless_tracker.datasets.video.images import open_stream
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image, check_image

# Suffix and codec. FFV1 is lossless; MPEG-4 is small, but blurs noise and edges.
LOSSLESS, LOSSY = (".mkv", "FFV1"), (".mp4", "mp4v")
# Numbered image folders start their names with this many digits.
DIGITS = 6


class RecordingWriter:
    """Writes a recording folder; use `new_recording`.

    Args:
        folder: an existing, empty folder.
        rig: cameras of the images; even sizes, as the codecs want.
        fps: rate, 1/s.
        lossless: write FFV1 (`NAME.mkv`) instead of MPEG-4 (`NAME.mp4`).

    Raises:
        DatasetError: a size is odd or a codec is missing.
    """

    def __init__(self, folder: Path, rig: CameraRig, fps: float, *, lossless: bool = False) -> None:
        self.folder, self.rig, self.fps = folder, rig, fps
        self._count = 0
        self._videos: dict[str, Any] = {}
        self._paths: dict[str, Path] = {}
        suffix, codec = LOSSLESS if lossless else LOSSY
        for camera in rig:
            if camera.size_px[0] % 2 or camera.size_px[1] % 2:
                raise DatasetError(
                    f"{camera.name}: a video of {camera.size_px[0]}x{camera.size_px[1]} px cannot "
                    "be written, expected even numbers"
                )
            path = self._paths[camera.name] = folder / f"{camera.name}{suffix}"
            fourcc = int.from_bytes(codec.encode("ascii"), "little")
            self._videos[camera.name] = cv2.VideoWriter(str(path), fourcc, fps, camera.size_px)
            if not self._videos[camera.name].isOpened():
                raise DatasetError(
                    f"{path}: cannot be written, this OpenCV lacks the codec {codec}"
                )
        write_calibration(folder / CALIBRATION, rig)

    def write(
        self, images: Mapping[str, Image], *, masks: Mapping[str, Image] | None = None
    ) -> None:
        """Append one set; `masks` (0 or 255) are written to `masks/NAME/FFFFFF.png`.

        Raises:
            DatasetError: a camera is missing, or a mask cannot be written; videos are checked when
                they are finished.
            ImageError: an image's size is not its camera's.
        """
        for camera in self.rig:
            if camera.name not in images:
                raise DatasetError(f"{camera.name}: no image of it in frame {self._count}")
            image = check_image(images[camera.name], camera.name, size_px=camera.size_px)
            self._videos[camera.name].write(_as_in_videos(image))
        for name, mask in (masks or {}).items():
            check_image(mask, f"mask of {name}", size_px=self.rig[name].size_px)
            write_image(self.folder / "masks" / name / f"{self._count:0{DIGITS}d}.png", mask)
        self._count += 1

    def write_background(self, name: str, images: Sequence[Image]) -> None:
        """Write a camera's empty-scene images, in colour as its video; see `write_background`."""
        colour = [_as_in_videos(image) for image in images]
        write_background(self.folder / BACKGROUND, self.rig[name], colour)

    def write_truth(self, track: MarkerTrack) -> None:
        """Write `ground_truth.trc`."""
        write_trc(truth_path(self.folder), track, self.fps)

    def close(self) -> None:
        """Finish the videos."""
        for video in self._videos.values():
            video.release()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
        if kind is None:
            self._check_videos()

    def _check_videos(self) -> None:
        """Make sure that the videos have all frames: OpenCV says nothing of a full disk."""
        for path in self._paths.values() if self._count else ():
            try:
                with closing(open_stream(path)) as stream:
                    whole = stream.frame_count == self._count
            except DatasetError:
                whole = False
            if not whole:
                raise DatasetError(
                    f"{path}: not all {self._count} frames were written: is the disk full?"
                )


@contextmanager
def new_recording(
    path: str | Path, rig: CameraRig, fps: float, *, lossless: bool = False
) -> Iterator[RecordingWriter]:
    """A writer whose folder appears at `path` when the block ends without an exception.

    Raises:
        DatasetError: `path` exists or cannot be written, or as `RecordingWriter` raises.
    """
    with new_folder(path) as folder, RecordingWriter(folder, rig, fps, lossless=lossless) as writer:
        yield writer


def write_background(folder: Path, camera: CameraModel, images: Sequence[Image]) -> None:
    """Write empty-scene images as lossless PNG: `NAME.png` if one, `NAME/000000.png`... if more.

    Raises:
        ImageError: an image's size is not the camera's.
        DatasetError: a file cannot be written.
    """
    for index, image in enumerate(images):
        check_image(image, f"background of {camera.name}", size_px=camera.size_px)
        name = camera.name if len(images) == 1 else f"{camera.name}/{index:0{DIGITS}d}"
        write_image(folder / f"{name}.png", image)


def write_image(path: Path, image: Image) -> None:
    """Write an image file; its folders are created.

    Raises:
        DatasetError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        done, data = cv2.imencode(path.suffix, image)
        if not done:
            raise DatasetError(f"{path}: cannot be encoded as {path.suffix}")
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written: {error.strerror}") from error


def _as_in_videos(image: Image) -> Image:
    """A grey image (h, w) as colour (h, w, 3): videos are colour."""
    if image.ndim == 3:
        return image
    return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR).astype("uint8", copy=False)
