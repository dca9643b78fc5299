"""What every source of synchronous images offers, whatever its format."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.imaging import Image


@dataclass(frozen=True, eq=False)
class FrameSet:
    """Images of all cameras at one time.

    Attributes:
        index: number of the set in its source, from 0.
        stamp_ns: capture time.
        images: camera name -> image (h, w, 3) BGR or (h, w) grey, uint8, at the recording's scale.
    """

    index: int
    stamp_ns: int
    images: Mapping[str, Image] = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", MappingProxyType(dict(self.images)))


class Recording(ABC):
    """Images of a calibrated rig, read in order; a context manager is not needed.

    Attributes:
        name: short name (of the folder or file).
        rig: the cameras of the images that `frames` yields (scaled).
        scale: factor from the stored images to those.
        fps: rate of the source, 1/s.
        frame_count: sets in the source, None if only reading tells.
    """

    def __init__(
        self, name: str, rig: CameraRig, *, scale: float, fps: float, frame_count: int | None
    ) -> None:
        self.name = name
        self.rig = rig
        self.scale = scale
        self.fps = fps
        self.frame_count = frame_count
        self._warnings: list[str] = []

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know, one line each; reading the images may add some."""
        return tuple(self._warnings)

    def warn(self, message: str) -> None:
        """Add a warning, once."""
        if message not in self._warnings:
            self._warnings.append(message)

    def frames(self, *, start: int = 0, every: int = 1) -> Iterator[FrameSet]:
        """Every `every`-th set from index `start` on, in order.

        Raises:
            ConfigError: `start` or `every` is impossible.
            DatasetError: the source turns out to be unreadable.
        """
        if start < 0 or every < 1:
            raise ConfigError(f"{self.name}: start {start}, every {every}: expected >= 0 and >= 1")
        if self.frame_count is not None and start >= self.frame_count:
            raise DatasetError(
                f"{self.name}: start at frame {start}, but it has {self.frame_count} frames"
            )
        return self._read(start, every)

    def start_index(self, stamp_ns: int) -> int:
        """The index of the set within half a frame of a stamp.

        Raises:
            DatasetError: there is none; says what the recording covers.
        """
        index = self._nearest(stamp_ns)
        if abs(self._stamp(index) - stamp_ns) > 0.5e9 / self.fps:
            raise DatasetError(
                f"{self.name}: no frame within half a frame of {stamp_ns / 1e9:.6f} s, "
                f"the nearest is at {self._stamp(index) / 1e9:.6f} s"
            )
        return index

    def background_frames(self) -> dict[str, list[Image]]:
        """Camera name -> empty-scene images (scaled); a camera without any is not there."""
        return {}

    def room_stills(self) -> dict[str, list[Image]]:
        """Camera name -> stills (scaled) of the room in which people may appear anywhere."""
        return {}

    def _nearest(self, stamp_ns: int) -> int:
        last = (self.frame_count or 1) - 1
        return min(max(round(stamp_ns * self.fps / 1e9), 0), last)

    def _stamp(self, index: int) -> int:
        return stamp_of(index, self.fps)

    @abstractmethod
    def _read(self, start: int, every: int) -> Iterator[FrameSet]: ...


def stamp_of(index: int, fps: float) -> int:
    """Stamp (ns) of frame `index` of a video at `fps` (1/s): round(index * 1e9 / fps)."""
    return round(index * 1e9 / fps)


def tidy_fps(fps: float) -> float:
    """The rate (1/s) meant by a measured or stored one.

    Within 1e-4 of a whole number it is that, or of a whole number * 1000/1001 (29.97 and its kin)
    that; otherwise it is rounded to 1/1000, so that a rate measured from stamps in ns and the
    container's own are the same float.
    """
    for whole in (float(round(fps)), round(fps * 1.001) * 1000.0 / 1001.0):
        if whole > 0.0 and abs(fps - whole) < 1e-4 * whole:
            return whole
    return round(fps, 3)


def every_for_fps(source_fps: float, fps: float | None) -> int:
    """k such that every k-th frame of a source gives `fps`; 1 for None.

    Raises:
        ConfigError: no k does; names the nearest rates that exist.
    """
    if fps is None:
        return 1
    if not 0.0 < fps <= source_fps * 1.001:
        raise ConfigError(f"fps {fps:g}: expected a rate above 0 and at most the source's {source_fps:g}")
    every = max(1, round(source_fps / fps))
    if abs(source_fps / every - fps) > 0.01 * fps:
        below, above = int(source_fps // fps) + 1, max(1, int(source_fps // fps))
        raise ConfigError(
            f"fps {fps:g}: the source has {source_fps:g}, keeping every k-th frame gives "
            f"{source_fps / above:.6g} or {source_fps / below:.6g}"
        )
    return every
