"""The interface of all recordings: sets of synchronous images of a calibrated rig."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets.background import read_background, read_background_models
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.datasets.markers.trc import read_trc
from markerless_tracker.datasets.truth import truth_path
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.geometry import FloatArray, apply
from markerless_tracker.imaging import BackgroundModel, Image

BACKGROUND = "background"


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
    """Images of a calibrated rig, read in order; needs no closing.

    Attributes:
        path: the folder; its `background/` is optional.
        name: its short name.
        rig: the cameras of the images that `frames` yields (scaled).
        scale: factor from the stored images to those.
        fps: rate of the source, 1/s.
        frame_count: number of sets in the source, None if it is unknown before reading.
    """

    def __init__(
        self,
        path: Path,
        stored_rig: CameraRig,
        *,
        scale: float,
        fps: float,
        frame_count: int | None,
    ) -> None:
        if not 0.0 < scale <= 1.0:
            raise ConfigError(f"scale {scale:g}: expected above 0 and at most 1")
        self.path = path
        self.name = path.resolve().name
        self.rig = stored_rig.scaled(scale)
        self._stored_sizes_px = {camera.name: camera.size_px for camera in stored_rig}
        self.scale = scale
        self.fps = fps
        self.frame_count = frame_count
        self._warnings: dict[str, str] = {}
        self._T_new_old: FloatArray | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Problems found, one line each; reading the images may add some."""
        return tuple(self._warnings.values())

    def warn(self, message: str, *, replaces: str | None = None) -> None:
        """Add a warning, once.

        Args:
            message: one line.
            replaces: a key; the warning takes the place of the last one with that key, such as
                the counts of an earlier reading.
        """
        self._warnings[replaces or message] = message

    def frames(self, *, start: int = 0, every: int = 1) -> Iterator[FrameSet]:
        """Every `every`-th set from index `start` on, in order.

        Raises:
            ConfigError: `start` or `every` is impossible.
            DatasetError: the source cannot be read.
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
            DatasetError: there is none; names the nearest.
        """
        index, nearest_ns = self._nearest(stamp_ns)
        if abs(nearest_ns - stamp_ns) > 0.5e9 / self.fps:
            raise DatasetError(
                f"{self.name}: no frame within half a frame of {stamp_ns / 1e9:.6f} s, "
                f"the nearest is at {nearest_ns / 1e9:.6f} s"
            )
        return index

    def of_cameras(self, names: Collection[str]) -> "Recording":
        """The recording of some of its cameras, if others need not be read; else itself."""
        return self

    def background_frames(self, folder: Path | None = None) -> dict[str, list[Image]]:
        """Camera name -> empty-scene images (scaled) from a folder, its own `background/` if None.

        Cameras without any are omitted; {} without that folder. Raises as `read_background` does.
        """
        folder = folder or self._own_backgrounds()
        if folder is None:
            return {}
        return read_background(folder, self.rig, stored_sizes_px=self._stored_sizes_px)

    def background_models(self, folder: Path | None = None) -> dict[str, BackgroundModel]:
        """Camera name -> learned background (`NAME.npz`, scaled) from a folder, or its own.

        As `background_frames`; raises as `read_background_models` does.
        """
        folder = folder or self._own_backgrounds()
        if folder is None:
            return {}
        return read_background_models(folder, self.rig, stored_sizes_px=self._stored_sizes_px)

    def _own_backgrounds(self) -> Path | None:
        folder = self.path / BACKGROUND
        return folder if folder.is_dir() else None

    def room_stills(self) -> dict[str, list[Image]]:
        """Camera name -> still images (scaled) of the room, in which people may be visible."""
        return {}

    def masks(self, camera: str) -> dict[int, Image]:
        """Frame index -> true silhouette (h, w) of a camera, 0 or 255, scaled; {} without any.

        Raises:
            DatasetError: a silhouette cannot be read.
        """
        return {}

    def stored_index(self, camera: str, index: int) -> int:
        """Number of the stored frame that a camera shows in the set `index`."""
        return index

    def ground_truth(self) -> MarkerTrack | None:
        """The reference markers, None without any; `ground_truth.trc` unless a format has others.

        Raises:
            DatasetError: their file cannot be read.
        """
        track = self._ground_truth()
        if track is None or self._T_new_old is None:
            return track
        return replace(track, positions_m=apply(self._T_new_old, track.positions_m))

    def _ground_truth(self) -> MarkerTrack | None:
        """The reference markers as stored."""
        path = truth_path(self.path)
        return read_trc(path) if path.is_file() else None

    def move(self, T_new_old: FloatArray) -> None:
        """Place the cameras and the reference markers in another world."""
        self.rig = self.rig.moved(T_new_old)
        before = self._T_new_old
        self._T_new_old = T_new_old if before is None else T_new_old @ before

    @property
    def is_moved(self) -> bool:
        """Whether the reference markers differ from the stored ones."""
        return self._T_new_old is not None

    @property
    def source(self) -> "Recording":
        """The whole recording of which this one is a part; itself if it is no part."""
        return self

    @abstractmethod
    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        """Index and stamp (ns) of the set nearest to a stamp."""

    @abstractmethod
    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        """The sets that `frames` yields; its arguments have been checked."""


class DerivedRecording(Recording):
    """Sets made of those of another recording; all that a subclass does not define is the other's.

    Args:
        recording: the other one.
    """

    def __init__(self, recording: Recording) -> None:
        self._inner = recording
        self.path, self.name, self.rig = recording.path, recording.name, recording.rig
        self.scale, self.fps = recording.scale, recording.fps
        self.frame_count = recording.frame_count
        self._stored_sizes_px = recording._stored_sizes_px
        self._warnings = {}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Problems found, one line each; those of the other recording first."""
        return (*self._inner.warnings, *self._warnings.values())

    def background_frames(self, folder: Path | None = None) -> dict[str, list[Image]]:
        """As of the other recording."""
        return self._inner.background_frames(folder)

    def background_models(self, folder: Path | None = None) -> dict[str, BackgroundModel]:
        """As of the other recording."""
        return self._inner.background_models(folder)

    def room_stills(self) -> dict[str, list[Image]]:
        """As of the other recording."""
        return self._inner.room_stills()

    def masks(self, camera: str) -> dict[int, Image]:
        """As of the other recording."""
        return self._inner.masks(camera)

    def stored_index(self, camera: str, index: int) -> int:
        """As of the other recording."""
        return self._inner.stored_index(camera, index)

    @property
    def is_moved(self) -> bool:
        """As of the other recording."""
        return self._inner.is_moved

    def ground_truth(self) -> MarkerTrack | None:
        """As of the other recording."""
        return self._inner.ground_truth()

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        return self._inner._nearest(stamp_ns)
