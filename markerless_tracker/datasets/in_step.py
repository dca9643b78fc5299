"""Synchronises cameras that began at different times, by whole frames."""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from markerless_tracker.datasets.recording import DerivedRecording, FrameSet, Recording
from markerless_tracker.datasets.video.rates import stamp_of
from markerless_tracker.errors import ConfigError, one_line
from markerless_tracker.imaging import Image

MOST_OFFSET_S = 60.0
"""Largest difference of two cameras' offsets: sets of that duration are held in memory."""


def read_time_offsets(text: str) -> dict[str, float]:
    """Offsets in s by camera, from `cam01=0.02,cam03=-0.1` or a YAML file of such a mapping.

    Raises:
        ConfigError: it is neither.
    """
    path = Path(text)
    try:
        if path.suffix in (".yaml", ".yml"):
            loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
        else:
            loaded = dict(entry.split("=") for entry in text.split(",") if entry)
        return {str(name): float(value) for name, value in loaded.items()}
    except (
        OSError, yaml.YAMLError, RecursionError, ValueError, TypeError, AttributeError,
    ) as error:  # fmt: skip
        reason = f": {one_line(error)}" if isinstance(error, (OSError, yaml.YAMLError)) else ""
        raise ConfigError(
            f"time offsets {text!r}: expected cam01=SECONDS,... or a YAML file with lines "
            f"`cam01: SECONDS`{reason}"
        ) from error


class InStepRecording(DerivedRecording):
    """A recording whose cameras' clocks differ by constant offsets.

    Frame k of a camera was taken at k / fps + offset. A set at time t has each camera's frame that
    was taken nearest to t. A warning states the largest error if it is above a quarter of a frame.
    The first sets, which a late camera lacks, are left out.

    Args:
        recording: the recording as it is stored.
        offsets_s: seconds by which a camera began late; 0 for cameras left out.

    Raises:
        ConfigError: a camera is unknown, the offsets differ by more than a minute, or the cameras
            share no time.
    """

    def __init__(self, recording: Recording, offsets_s: Mapping[str, float]) -> None:
        unknown = sorted(set(offsets_s) - set(recording.rig.names))
        if unknown:
            raise ConfigError(
                f"time offsets: no camera {', '.join(unknown)}, expected "
                f"{', '.join(recording.rig.names)}"
            )
        frames = {name: offsets_s.get(name, 0.0) * recording.fps for name in recording.rig.names}
        range_s = (max(frames.values()) - min(frames.values())) / recording.fps
        if not (all(map(math.isfinite, frames.values())) and range_s <= MOST_OFFSET_S):
            listed = ", ".join(f"{name} {offset:g}" for name, offset in offsets_s.items())
            raise ConfigError(
                f"time offsets in s: {listed}; expected differences of at most {MOST_OFFSET_S:g}"
            )
        super().__init__(recording)
        self._shifts = {name: round(value) for name, value in frames.items()}
        self._first = max(0, *self._shifts.values())
        count = recording.frame_count
        self.frame_count = None if count is None else count + min(self._shifts.values())
        if self.frame_count is not None and self.frame_count <= self._first:
            listed = ", ".join(f"{name} {offset:g}" for name, offset in offsets_s.items())
            raise ConfigError(
                f"time offsets in s: {listed}; the cameras share no time in {recording.name} of "
                f"{(count or 0) / recording.fps:g} s"
            )
        worst = max(abs(value - self._shifts[name]) for name, value in frames.items())
        if worst > 0.25:
            self.warn(
                f"{self.name}: time offsets are met to whole frames only: up to "
                f"{1000.0 * worst / self.fps:.1f} ms remain"
            )

    def masks(self, camera: str) -> dict[int, Image]:
        """As of the other recording, by the index of the set that shows the frame."""
        shift = self._shifts[camera]
        return {index + shift: mask for index, mask in self._inner.masks(camera).items()}

    def stored_index(self, camera: str, index: int) -> int:
        """Number of the stored frame that a camera shows in the set `index`."""
        return self._inner.stored_index(camera, index - self._shifts[camera])

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        index, nearest_ns = self._inner._nearest(stamp_ns)
        inside = max(index, self._first)
        if self.frame_count is not None:
            inside = min(inside, self.frame_count - 1)
        # By the recording's rate, since sets outside have no stamp of their own.
        return inside, nearest_ns + stamp_of(inside - index, self.fps)

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        begin = max(start, self._first)
        least, most = min(self._shifts.values()), max(self._shifts.values())
        held: deque[FrameSet] = deque(maxlen=most - least + 1)
        for stored in self._inner.frames(start=begin - most):
            held.append(stored)
            # The newest stored set completes this one.
            index = stored.index + least
            if index < begin or (index - begin) % every:
                continue
            images = {
                name: held[index - shift - stored.index - 1].images[name]
                for name, shift in self._shifts.items()
            }
            # The stored set of that number has the stamp, while it is held.
            near = held[index - stored.index - 1] if least <= 0 <= most else stored
            stamp_ns = near.stamp_ns + stamp_of(index - near.index, self.fps)
            yield FrameSet(index, stamp_ns, images)
