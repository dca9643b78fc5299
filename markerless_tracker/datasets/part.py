"""A part of a recording: some of its cameras, a range of its time."""

from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TypeVar

from markerless_tracker.camera import CameraRig
from markerless_tracker.datasets.recording import DerivedRecording, FrameSet, Recording
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.imaging import BackgroundModel, Image

T = TypeVar("T")


class PartRecording(DerivedRecording):
    """Some cameras of a recording between two times; indices and stamps stay those of the source.

    Args:
        recording: the whole.
        cameras: names of the cameras, in any order; None takes all.
        from_s: s from the first set on; earlier sets are left out.
        until_s: s from the first set on; later sets are left out; None goes to the end.

    Raises:
        ConfigError: an unknown camera, no camera, or an impossible time.
        DatasetError: the recording has no set in that time.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        cameras: Sequence[str] | None = None,
        from_s: float = 0.0,
        until_s: float | None = None,
    ) -> None:
        known = recording.rig.names
        chosen = known if cameras is None else tuple(cameras)
        unknown = [name for name in chosen if name not in known]
        if unknown or not chosen:
            raise ConfigError(
                f"{recording.name}: no camera {', '.join(unknown) or 'chosen'}, expected some of "
                f"{', '.join(known)}"
            )
        if not 0.0 <= from_s < 1e9 or not (until_s is None or from_s <= until_s < 1e9):
            raise ConfigError(
                f"{recording.name}: time from {from_s:g} s to "
                f"{'the end' if until_s is None else f'{until_s:g} s'}, expected 0 <= start <= end"
            )
        super().__init__(recording)
        self._images = images = recording.of_cameras(chosen)
        # Warnings about cameras that are left out do not concern the part.
        self._unrelated = frozenset(recording.warnings) - frozenset(images.warnings)
        self.frame_count = images.frame_count
        self.rig = CameraRig(tuple(camera for camera in recording.rig if camera.name in chosen))
        _, first_ns = images._nearest(-(2**62))
        half_ns = round(0.5e9 / images.fps)
        self._until_ns = None if until_s is None else first_ns + round(until_s * 1e9) + half_ns
        self._first = 0
        if from_s > 0.0:
            wanted_ns = first_ns + round(from_s * 1e9)
            self._first, nearest_ns = images._nearest(wanted_ns)
            if wanted_ns - nearest_ns > half_ns:
                raise DatasetError(
                    f"{recording.name}: ends {(nearest_ns - first_ns) / 1e9:.3f} s after its first "
                    f"set, expected to start at {from_s:g} s"
                )
        if self._until_ns is not None and images.frame_count is not None:
            last, _ = images._nearest(self._until_ns - half_ns)
            self.frame_count = min(images.frame_count, last + 1)

    @property
    def first(self) -> int:
        """Index of the first set of the part."""
        return self._first

    @property
    def warnings(self) -> tuple[str, ...]:
        """As of the whole, of the part's cameras."""
        found = (*self._images.warnings, *self._inner.warnings, *self._warnings.values())
        return tuple(text for text in dict.fromkeys(found) if text not in self._unrelated)

    @property
    def source(self) -> Recording:
        """The whole."""
        return self._inner.source

    def background_frames(self, folder: Path | None = None) -> dict[str, list[Image]]:
        """As of the whole, of the part's cameras."""
        return self._own(self._inner.background_frames(folder))

    def background_models(self, folder: Path | None = None) -> dict[str, BackgroundModel]:
        """As of the whole, of the part's cameras."""
        return self._own(self._inner.background_models(folder))

    def room_stills(self) -> dict[str, list[Image]]:
        """As of the whole, of the part's cameras."""
        return self._own(self._inner.room_stills())

    def _own(self, found: dict[str, T]) -> dict[str, T]:
        return {name: value for name, value in found.items() if name in self.rig.names}

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        return self._images._nearest(stamp_ns)

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        def inside(frame: FrameSet) -> bool:
            return self._until_ns is None or frame.stamp_ns <= self._until_ns

        begin = max(start, self._first)
        for frame in takewhile(inside, self._images.frames(start=begin, every=every)):
            images = {name: frame.images[name] for name in self.rig.names}
            yield FrameSet(frame.index, frame.stamp_ns, images)
