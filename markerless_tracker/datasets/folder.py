"""Recordings as files: a calibration, and one video or folder of numbered images per camera."""

import copy
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from markerless_tracker.camera import CameraRig, read_calibration
from markerless_tracker.datasets.recording import FrameSet, Recording
from markerless_tracker.datasets.video.decode import read_together
from markerless_tracker.datasets.video.images import ImageStream, find_stream, open_stream
from markerless_tracker.datasets.video.masks import masks_by_frame, read_mask
from markerless_tracker.datasets.video.numbering import check_numbers
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.errors import ConfigError, DatasetError, ImageError
from markerless_tracker.imaging import Image

CALIBRATION = "calibration.toml"
_LENGTHS = "lengths"
"""Key of the warning about cameras of different lengths."""


class VideoRecording(Recording):
    """Images from one source per camera; frames of one index form a set.

    The recording ends with its shortest camera.

    Args:
        path: folder of the recording, for messages and `background/`.
        sources: camera name -> video or folder of numbered images.
        rig: the cameras of the stored images.
        scale: factor for all images.
        input_fps: rate of numbered images (overrides that of videos), 1/s.

    Raises:
        DatasetError: a source cannot be read or lacks an image, rates differ or are unknown.
        ImageError: a source's images do not have their calibration's size.
        ConfigError: the scale or rate is impossible.
    """

    def __init__(
        self,
        path: Path,
        sources: Mapping[str, Path],
        rig: CameraRig,
        *,
        scale: float = 1.0,
        input_fps: float | None = None,
    ) -> None:
        if input_fps is not None and not 0.0 < input_fps < 1e5:
            raise ConfigError(f"input fps {input_fps:g}: expected a rate above 0")
        self._sources = dict(sources)
        self._input_fps = input_fps
        streams = {
            name: open_stream(source, input_fps=input_fps) for name, source in sources.items()
        }
        for stream in streams.values():
            stream.close()
        for camera in rig:
            stream, expected = streams[camera.name], camera.size_px
            if stream.size_px != expected:
                raise ImageError(
                    f"{camera.name}: {stream.path} has images of {stream.size_px[0]}x"
                    f"{stream.size_px[1]} px, expected {expected[0]}x{expected[1]} px as calibrated"
                )
        rates = {name: stream.fps for name, stream in streams.items()}
        super().__init__(path, rig, scale=scale, fps=_common_rate(path, rates), frame_count=None)
        # The stated counts; a camera without one can only be read to its end.
        self._counts = {name: stream.frame_count for name, stream in streams.items()}
        self._most_frames: int | None = None
        folders = {name: source for name, source in sources.items() if source.is_dir()}
        for warning in check_numbers(folders):
            self.warn(warning)
        self._end_with_shortest()

    def of_cameras(self, names: Collection[str]) -> "VideoRecording":
        """As of every recording; it ends with the shortest of these cameras."""
        some = copy.copy(self)
        some.rig = CameraRig(tuple(camera for camera in self.rig if camera.name in names))
        some._sources = {name: self._sources[name] for name in some.rig.names}
        some._counts = {name: self._counts[name] for name in some.rig.names}
        some._warnings = {k: text for k, text in self._warnings.items() if k != _LENGTHS}
        some._end_with_shortest()
        return some

    def _end_with_shortest(self) -> None:
        """End with the shortest camera, with a warning if their stated lengths differ."""
        counts = self._counts
        stated = [count for count in counts.values() if count is not None]
        self._most_frames = min(stated) if stated else None
        self.frame_count = self._most_frames if len(stated) == len(counts) else None
        if len(set(stated)) > 1:
            listed = ", ".join(f"{name} {count or 'unknown'}" for name, count in counts.items())
            self.warn(
                f"{self.name}: cameras differ in length ({listed} frames), the recording ends "
                f"after {self._most_frames}",
                replaces=_LENGTHS,
            )

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        streams = {
            name: open_stream(source, input_fps=self._input_fps)
            for name, source in self._sources.items()
        }
        sizes = {camera.name: camera.size_px for camera in self.rig}
        for index, images in read_together(streams, sizes, start=start, every=every):
            if self._most_frames is not None and index >= self._most_frames:
                return
            ended = [name for name, image in images.items() if image is None]
            if ended:
                if index == start:
                    raise DatasetError(
                        f"{self.name}: {', '.join(ended)} has no frame {start}, expected to start "
                        "there"
                    )
                self._warn_of_end(ended, max(index - every, 0))
                return
            self._warn_of_pace(streams)
            yield FrameSet(
                index,
                stamp_of(index, self.fps),
                {name: image for name, image in images.items() if image is not None},
            )

    def _warn_of_end(self, ended: Sequence[str], last: int) -> None:
        """Warn unless the frames ended as stated, or without a statement at once in all cameras."""
        if self._most_frames is not None:
            self.warn(
                f"{self.name}: {', '.join(ended)} cannot be read beyond frame {last} of "
                f"{self._most_frames}, the recording ends there"
            )
        elif len(ended) < len(self.rig):
            self.warn(
                f"{self.name}: {', '.join(ended)} ends after frame {last}, before the other "
                "cameras; the recording ends there"
            )

    def _warn_of_pace(self, streams: Mapping[str, ImageStream]) -> None:
        """Warn once of each camera whose video has no constant rate."""
        for name, stream in streams.items():
            if stream.uneven is not None:
                self.warn(
                    f"{self.name}: {name}: variable frame rate: frame {stream.uneven.frame} is "
                    f"{1000.0 * stream.uneven.late_s:+.0f} ms beside the constant rate of its "
                    "file, expected a video of constant rate: stamps are wrong from there on"
                )

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        index = max(round(stamp_ns * self.fps / 1e9), 0)
        if self._most_frames is not None:
            index = min(index, self._most_frames - 1)
        return index, stamp_of(index, self.fps)


class FolderRecording(VideoRecording):
    """A recording folder: `calibration.toml` and one video or image folder per camera."""

    def __init__(self, path: Path, *, scale: float = 1.0, input_fps: float | None = None) -> None:
        rig = read_calibration(path / CALIBRATION)
        sources = {camera.name: find_stream(path, camera.name) for camera in rig}
        missing = [name for name, source in sources.items() if source is None]
        if missing:
            raise DatasetError(
                f"{path}: no images of {', '.join(missing)}, expected {missing[0]}.mp4 "
                "(or .mkv, .avi, .mov, or a folder of that name with numbered images)"
            )
        found = {name: source for name, source in sources.items() if source is not None}
        super().__init__(path, found, rig, scale=scale, input_fps=input_fps)

    def masks(self, camera: str) -> dict[int, Image]:
        """As of every recording; from `masks/NAME/`."""
        folder = self.path / "masks" / camera
        files = masks_by_frame(folder) if folder.is_dir() else {}
        size_px = self.rig[camera].size_px
        return {index: read_mask(file, size_px) for index, file in files.items()}


def _common_rate(path: Path, rates: Mapping[str, float | None]) -> float:
    for name, rate in rates.items():
        if rate is None:
            raise DatasetError(f"{path}: {name} states no rate, expected --input-fps")
    if len(set(rates.values())) > 1:
        listed = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
        raise DatasetError(f"{path}: cameras differ in rate ({listed} fps), expected one rate")
    return next(rate for rate in rates.values() if rate is not None)
