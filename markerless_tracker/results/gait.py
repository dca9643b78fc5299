"""Gait events and parameters of a person who walks, from the ankles and the pelvis.

Events by the coordinates of the foot relative to the pelvis along the direction of progress (Zeni,
Richards and Higginson, Gait & Posture 27, 2008): foot strike when the foot is farthest ahead, foot
off when it is farthest behind. The ankles are used instead of heel and toes, so that foot off, and
the stance with it, is less certain than foot strike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, find_peaks, sosfiltfilt

from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.stored_result import StoredResult

METHOD = (
    "Zeni et al. 2008: foot strike and foot off where the ankle is farthest ahead of and behind "
    "the pelvis along the direction of progress; positions low-passed at 6 Hz (Butterworth, no lag)"
)
"""How the events are found, for people."""
LEAST_SPEED_M_S = 0.3
"""Least speed of the pelvis of a walking person."""
LEAST_FPS = 15.0
"""Lowest rate of a result for which events are found."""

_CUTOFF_HZ, _PROGRESS_HZ = 6.0, 0.8
_LONGEST_GAP_S, _LEAST_S = 0.15, 1.0
_PROMINENCE_M, _APART_S = 0.10, 0.4
# Longest time between two strikes of a foot while walking.
_LONGEST_STRIDE_S = 2.5


@dataclass(frozen=True)
class Event:
    """A foot strike or foot off.

    Attributes:
        side: "left" or "right".
        strike: whether it is a foot strike; else a foot off.
        time_s: when.
        position_m: (3,) of the ankle, world frame.
    """

    side: str
    strike: bool
    time_s: float
    position_m: tuple[float, float, float]


@dataclass(frozen=True)
class Stride:
    """From a strike of a foot to its next one.

    Attributes:
        side: "left" or "right".
        from_s, to_s: times of the strikes.
        length_m: distance of the ankle between them, on the floor.
        speed_m_s: distance that the pelvis covers on the floor, by time.
        stance: fraction of the time before foot off; NaN if foot off was not found.
    """

    side: str
    from_s: float
    to_s: float
    length_m: float
    speed_m_s: float
    stance: float


@dataclass(frozen=True)
class Parameter:
    """A parameter over the strides: mean, standard deviation (NaN of one value), number."""

    name: str
    unit: str
    mean: float
    sd: float
    count: int


@dataclass(frozen=True)
class Gait:
    """Events and strides while the person walked.

    Attributes:
        events: in order of time.
        strides: of both feet, in order of time.
        steps_s: times between successive strikes of different feet.
    """

    events: tuple[Event, ...]
    strides: tuple[Stride, ...]
    steps_s: tuple[float, ...]

    def parameters(self) -> tuple[Parameter, ...]:
        """Stride length and time, speed, cadence and stance, over both feet."""
        return (
            _parameter("stride length", "m", [stride.length_m for stride in self.strides]),
            _parameter(
                "stride time", "s", [stride.to_s - stride.from_s for stride in self.strides]
            ),
            _parameter("speed", "m/s", [stride.speed_m_s for stride in self.strides]),
            _parameter("cadence", "steps/min", [60.0 / step for step in self.steps_s]),
            _parameter("stance", "%", [100.0 * stride.stance for stride in self.strides]),
        )


def gait(result: StoredResult) -> Gait | None:
    """Events and parameters where the person walks over the floor; None where there is no stride.

    A person on a treadmill stays in place and does not walk in this sense. Gaps of up to 0.15 s
    are interpolated.

    Args:
        result: at least `LEAST_FPS`.
    """
    if result.fps < LEAST_FPS or not len(result):
        return None
    feet = {"left": result.position("LAnkle"), "right": result.position("RAnkle")}
    events: list[Event] = []
    strides: list[Stride] = []
    steps: list[float] = []
    for part in _parts(result):
        times = np.arange(result.times_s[part[0]], result.times_s[part[-1]], 1.0 / result.fps)
        pelvis, left, right = (
            _smoothed(_even(times, result.times_s[part], track[part]), result.fps, _CUTOFF_HZ)
            for track in (result.position("Pelvis"), *feet.values())
        )
        for walk in _walks(pelvis, result.fps):
            tracks = {"left": left[walk], "right": right[walk]}
            found = _events(times[walk], pelvis[walk], tracks, result.fps)
            events += found
            strides += _strides(found, times[walk], pelvis[walk])
            steps += _steps(found)
    strides.sort(key=lambda stride: stride.from_s)
    return Gait(tuple(events), tuple(strides), tuple(steps)) if strides else None


def _parts(result: StoredResult) -> list[NDArray[np.int64]]:
    """Rows with a pose of each part of the result without a long gap."""
    rows = np.flatnonzero(np.isfinite(result.position("Pelvis")).all(axis=1))
    if not rows.size:
        return []
    longest = max(_LONGEST_GAP_S, 1.5 / result.fps)
    breaks = np.flatnonzero(np.diff(result.times_s[rows]) > longest) + 1
    least = _LEAST_S * result.fps
    return [part for part in np.split(rows, breaks) if part.size >= least]


def _even(times: FloatArray, known_s: FloatArray, positions: FloatArray) -> FloatArray:
    """Positions (n, 3) at evenly spaced times."""
    return np.column_stack([np.interp(times, known_s, column) for column in positions.T])


def _smoothed(values: FloatArray, fps: float, cutoff_hz: float) -> FloatArray:
    """Values (n, ...) passed forward and backward through a Butterworth filter."""
    if cutoff_hz >= 0.45 * fps:
        return values
    sections = butter(2, cutoff_hz, fs=fps, output="sos")
    pad = min(len(values) - 1, round(1.5 * fps / cutoff_hz))
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=pad), dtype=np.float64)


def _walks(pelvis: FloatArray, fps: float) -> list[slice]:
    """Parts in which the pelvis moves over the floor for long enough."""
    moving = np.linalg.norm(_velocity(pelvis, fps), axis=1) >= LEAST_SPEED_M_S
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [slice(a, b) for a, b in pairs if b - a >= _LEAST_S * fps]


def _velocity(pelvis: FloatArray, fps: float) -> FloatArray:
    """(n, 2) velocity of the pelvis on the floor, without the sway of single steps, m/s."""
    return np.asarray(np.gradient(_smoothed(pelvis[:, :2], fps, _PROGRESS_HZ), 1.0 / fps, axis=0))


def _events(
    times: FloatArray, pelvis: FloatArray, feet: dict[str, FloatArray], fps: float
) -> list[Event]:
    velocity = _velocity(pelvis, fps)
    ahead = velocity / np.linalg.norm(velocity, axis=1)[:, None]
    found = []
    for side, foot in feet.items():
        along = ((foot - pelvis)[:, :2] * ahead).sum(axis=1)
        for strike, signal in ((True, along), (False, -along)):
            peaks, _ = find_peaks(
                signal, prominence=_PROMINENCE_M, distance=max(1, round(_APART_S * fps))
            )
            for row in peaks.tolist():
                x, y, z = foot[row].tolist()
                found.append(Event(side, strike, float(times[row]), (x, y, z)))
    return sorted(found, key=lambda event: event.time_s)


def _strides(events: Sequence[Event], times: FloatArray, pelvis: FloatArray) -> list[Stride]:
    """Strides between two strikes of a foot with one of the other foot in between."""
    found = []
    for side in ("left", "right"):
        own = [event for event in events if event.strike and event.side == side]
        for first, second in pairwise(own):
            between = [e for e in events if first.time_s < e.time_s < second.time_s]
            others = sum(event.strike and event.side != side for event in between)
            duration = second.time_s - first.time_s
            if others != 1 or duration > _LONGEST_STRIDE_S:
                continue
            offs = [e.time_s for e in between if e.side == side and not e.strike]
            rows = np.searchsorted(times, (first.time_s, second.time_s))
            way = np.diff(pelvis[rows[0] : rows[1] + 1, :2], axis=0)
            found.append(
                Stride(
                    side,
                    first.time_s,
                    second.time_s,
                    float(np.hypot(*np.subtract(second.position_m, first.position_m)[:2])),
                    float(np.linalg.norm(way, axis=1).sum()) / duration,
                    (offs[0] - first.time_s) / duration if len(offs) == 1 else np.nan,
                )
            )
    return found


def _steps(events: Sequence[Event]) -> list[float]:
    strikes = [event for event in events if event.strike]
    return [
        second.time_s - first.time_s
        for first, second in pairwise(strikes)
        if first.side != second.side and second.time_s - first.time_s <= _LONGEST_STRIDE_S / 2.0
    ]


def _parameter(name: str, unit: str, values: Sequence[float]) -> Parameter:
    known = np.array([value for value in values if np.isfinite(value)])
    mean = float(known.mean()) if known.size else np.nan
    sd = float(known.std(ddof=1)) if known.size > 1 else np.nan
    return Parameter(name, unit, mean, sd, int(known.size))
