"""Whether cameras run in step, from motion alone.

All cameras see the same person move: the sum of changes from frame to frame rises and falls in all
of them at the same time. The lag of best correlation of two cameras is their offset.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.geometry import FloatArray

MOST_LAG_S = 1.5
"""Largest offset that is searched."""
LEAST_CORRELATION = 0.45
"""Pairs whose best correlation is lower are not used."""
LEAST_EVIDENCE = 5.0
"""And so are those whose best correlation times the root of the common frames is lower."""
LEAST_FRAMES = 40
_SMOOTH_S = 1.0
_LEAST_MOTION = 0.02
_ROUNDS = 6
_LAG_PENALTY = 0.25
_SIMILAR = 0.2


@dataclass(frozen=True)
class Offsets:
    """Offsets of the cameras.

    Attributes:
        frames: camera -> frames by which it shows the motion late, relative to the median camera;
            cameras of which nothing can be said are missing.
        correlation: camera -> mean correlation of the pairs it is in, at these offsets.
        gained: camera -> how much higher that is than without offsets.
        others: camera -> further such offsets that fit almost as well: motion repeats itself.
        pairs: number of pairs used.
    """

    frames: Mapping[str, float]
    correlation: Mapping[str, float]
    gained: Mapping[str, float]
    others: Mapping[str, tuple[int, ...]]
    pairs: int


def find_offsets(motion: Mapping[str, FloatArray], fps: float) -> Offsets:
    """Offsets of cameras by their motion signals (n,) each.

    The offsets maximise the sum of the correlations of all pairs, one camera after the other, from
    none on. Steps of a walk look alike: of similar offsets the smaller one is taken. Of a
    camera that resembles the others less than LEAST_CORRELATION at the offsets found, nothing is
    said.
    """
    names = [n for n, m in motion.items() if len(m) >= LEAST_FRAMES and m.mean() > _LEAST_MOTION]
    signals = {n: _varying(motion[n], fps) for n in names}
    most = int(min(MOST_LAG_S * fps, 0.4 * min((len(s) for s in signals.values()), default=0)))
    pairs: dict[tuple[str, str], FloatArray] = {}
    for a, b in combinations(names, 2):
        values = [_correlation(signals[a], signals[b], lag) for lag in range(-most, most + 1)]
        common = min(len(signals[a]), len(signals[b])) - abs(int(np.argmax(values)) - most)
        if max(values) >= max(LEAST_CORRELATION, LEAST_EVIDENCE / np.sqrt(common)):
            pairs[a, b] = np.array(values)
            pairs[b, a] = pairs[a, b][::-1]
    names = [n for n in names if any(n in pair for pair in pairs)]
    offsets = dict.fromkeys(names, 0)
    lags = np.arange(-most, most + 1)
    for _ in range(_ROUNDS):
        before = dict(offsets)
        for name in names:
            offsets[name] = int(lags[np.argmax(_totals(name, offsets, pairs, lags))])
        if offsets == before:
            break
    exact = {n: _peak(_totals(n, offsets, pairs, lags), lags) for n in names}
    middle = float(np.median(list(exact.values()))) if exact else 0.0
    still, there = (
        {n: [_at(pairs[n, m], at[m], at[n]) for m in names if (n, m) in pairs] for n in names}
        for at in (dict.fromkeys(names, 0), offsets)
    )
    sure = [n for n in names if np.mean(there[n]) >= LEAST_CORRELATION]
    return Offsets(
        {n: exact[n] - middle for n in sure},
        {n: float(np.mean(there[n])) for n in sure},
        {n: float(np.mean(there[n]) - np.mean(still[n])) for n in sure},
        {n: _similar(_totals(n, offsets, pairs, lags), lags - round(middle)) for n in sure},
        len(pairs) // 2,
    )


def _totals(
    name: str,
    offsets: Mapping[str, int],
    pairs: Mapping[tuple[str, str], FloatArray],
    lags: NDArray[np.int_],
) -> FloatArray:
    """Sum of a camera's correlations with the others at each offset of it."""
    total: FloatArray = -_LAG_PENALTY * np.abs(lags) / max(len(lags) // 2, 1)
    others = [m for m in offsets if (name, m) in pairs]
    for other in others:
        values = [_at(pairs[name, other], offsets[other], int(lag)) for lag in lags]
        total = total + np.array(values) / len(others)
    return total


def _at(correlations: FloatArray, other: int, own: int) -> float:
    """Correlation at a camera's own offset, for pairs (own, other); 0 beyond the lags searched."""
    place = other - own + len(correlations) // 2
    return float(correlations[place]) if 0 <= place < len(correlations) else 0.0


def _similar(totals: FloatArray, lags: NDArray[np.int_]) -> tuple[int, ...]:
    """Offsets of the other maxima that are almost as high as the best."""
    best = int(np.argmax(totals))
    inner = np.flatnonzero((totals[1:-1] >= totals[:-2]) & (totals[1:-1] >= totals[2:])) + 1
    near = [i for i in inner if i != best and totals[i] > totals[best] - _SIMILAR]
    return tuple(int(lags[i]) for i in near)


def _peak(totals: FloatArray, lags: NDArray[np.int_]) -> float:
    """The best offset, between frames by a parabola."""
    best = int(np.argmax(totals))
    exact = float(lags[best])
    if 0 < best < len(totals) - 1:
        before, at, after = totals[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        exact += float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
    return exact


def _varying(motion: FloatArray, fps: float) -> FloatArray:
    """The signal without its slow part, so that lags do not hide in a trend."""
    signal = np.sqrt(np.maximum(motion[1:], 0.0))
    # Compression repeats a peak at every key frame: it is cut off.
    signal = np.minimum(signal, np.quantile(signal, 0.98))
    width = max(3, round(_SMOOTH_S * fps) | 1)
    padded = np.pad(signal, width // 2, mode="edge")
    slow = np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    return np.asarray(signal - slow)


def _correlation(a: FloatArray, b: FloatArray, lag: int) -> float:
    first, second = (a[: len(a) - lag], b[lag:]) if lag >= 0 else (a[-lag:], b[: len(b) + lag])
    count = min(len(first), len(second))
    first, second = first[:count], second[:count]
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size > 0.0 else 0.0
