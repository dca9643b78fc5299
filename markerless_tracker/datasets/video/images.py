"""One camera's images from a video file or a folder of numbered images, in order."""

from abc import ABC, abstractmethod
from pathlib import Path

import cv2
import numpy as np

from markerless_tracker.datasets.video.pace import Pace, Uneven
from markerless_tracker.datasets.video.rates import tidy_fps
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Image

VIDEO_SUFFIXES = (".mp4", ".mkv", ".avi", ".mov")
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


class ImageStream(ABC):
    """Images of one camera, read forward only.

    Attributes:
        path: the file or folder.
        size_px: (width, height) of its images.
        fps: rate in 1/s, None if the source states none.
        frame_count: number of images as stated by the source, None if it states none (streamed
            files).
    """

    path: Path
    size_px: tuple[int, int]
    fps: float | None
    frame_count: int | None

    @abstractmethod
    def read(self) -> Image | None:
        """The next image, None at the end."""

    @abstractmethod
    def skip(self) -> bool:
        """Pass over the next image; False at the end."""

    @property
    def uneven(self) -> Uneven | None:
        """The first image found beside a constant rate; None without, or if no times are stored."""
        return None

    def close(self) -> None:
        """Release the source."""
        return


class VideoStream(ImageStream):
    """A video, decoded by OpenCV.

    Raises:
        DatasetError: the file cannot be opened or its first image cannot be decoded.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise DatasetError(f"{path}: no such video")
        self._capture = cv2.VideoCapture(str(path))
        got, first = self._capture.read() if self._capture.isOpened() else (False, None)
        if not got or first is None:
            self._capture.release()
            size = path.stat().st_size
            raise DatasetError(
                f"{path}: cannot be read as a video, or holds no image ({size} bytes)"
            )
        self._first: Image | None = np.asarray(first, dtype=np.uint8)
        self.size_px = (int(first.shape[1]), int(first.shape[0]))
        rate = float(self._capture.get(cv2.CAP_PROP_FPS))
        self.fps = tidy_fps(rate) if 0.0 < rate < 1e5 else None
        self._pace = Pace(rate if self.fps is not None else None)
        self._timed()
        # OpenCV gives 0, a negative number or NaN where the container holds no duration.
        count = float(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        self.frame_count = int(count) if 1.0 <= count < 2**62 else None

    def read(self) -> Image | None:
        """The next image (h, w, 3) BGR, None at the end."""
        image, self._first = self._first, None
        if image is not None:
            return image
        got, decoded = self._capture.read()
        if not got or decoded is None:
            return None
        self._timed()
        return np.asarray(decoded, dtype=np.uint8)

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        if self._first is not None:
            self._first = None
            return True
        grabbed = bool(self._capture.grab())
        if grabbed:
            self._timed()
        return grabbed

    @property
    def uneven(self) -> Uneven | None:
        """As of every stream."""
        return self._pace.uneven

    def close(self) -> None:
        """Release the decoder."""
        self._capture.release()

    def _timed(self) -> None:
        self._pace.add(float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1000.0)


class NumberedImages(ImageStream):
    """A folder of images, in the order of their names.

    Raises:
        DatasetError: the folder holds no image or the first cannot be read.
    """

    def __init__(self, path: Path, fps: float | None = None) -> None:
        self.path = path
        self.fps = fps
        self._files = numbered_files(path)
        if not self._files:
            raise DatasetError(f"{path}: holds no image, expected {', '.join(IMAGE_SUFFIXES)}")
        self._next = 0
        first = read_image(self._files[0])
        self.size_px = (int(first.shape[1]), int(first.shape[0]))
        self.frame_count = len(self._files)

    def read(self) -> Image | None:
        """The next image, None at the end."""
        if self._next >= len(self._files):
            return None
        self._next += 1
        return read_image(self._files[self._next - 1])

    def skip(self) -> bool:
        """Pass over the next image; False at the end."""
        self._next += 1
        return self._next <= len(self._files)


def numbered_files(folder: Path) -> list[Path]:
    """The image files of a folder, by number where names end in one, by name otherwise."""

    def order(path: Path) -> tuple[int, str]:
        number = image_number(path)
        return -1 if number is None else number, path.name

    files = (file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES)
    return sorted(files, key=order)


def image_number(path: Path) -> int | None:
    """The number at the end of an image's name, None without one."""
    digits = path.stem[len(path.stem.rstrip("0123456789")) :]
    return int(digits) if digits else None


def read_image(path: Path) -> Image:
    """An image file as 8-bit grey (h, w) or BGR (h, w, 3).

    Raises:
        DatasetError: it cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_ANYCOLOR)
    if image is None:
        raise DatasetError(f"{path}: cannot be read as an image")
    return np.asarray(image, dtype=np.uint8)


def find_stream(folder: Path, name: str) -> Path | None:
    """The video `name.mp4` (.mkv, .avi, .mov) or the folder of images `name` in a folder."""
    for suffix in VIDEO_SUFFIXES:
        # Cameras write .MP4 as well.
        for ending in (suffix, suffix.upper()):
            path = folder / f"{name}{ending}"
            if path.is_file():
                return path
    path = folder / name
    return path if path.is_dir() and numbered_files(path) else None


def open_stream(path: Path, *, input_fps: float | None = None) -> ImageStream:
    """Open a video file or a folder of numbered images.

    Args:
        path: file or folder.
        input_fps: rate of numbered images, 1/s; overrides the rate of a video.
    """
    if path.is_dir():
        return NumberedImages(path, input_fps)
    stream = VideoStream(path)
    if input_fps is not None:
        stream.fps = input_fps
    return stream
