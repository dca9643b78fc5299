"""Time offsets between cameras, estimated from motion alone.

All cameras see the same person move. The sum of changes from frame to frame therefore rises and
falls in all of them at the same time. The lag of maximum cross-correlation of two cameras is their
offset.
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
LEAST_EVIDENCE, LEAST_STILL = 4.5, 1.5
"""Nor are pairs whose best correlation times the root of the number of independent common frames is
lower; the second, if they correlate almost as well without an offset. Many offsets are tried, and
motion is smooth: signals of a few strides correlate well at a wrong offset, too."""
LEAST_FRAMES = 40
_SMOOTH_S, _STRIDE_S = 1.0, 0.33
_LEAST_MOTION = 0.02
_ROUNDS = 6
_LAG_PENALTY = 0.25
_SIMILAR = 0.2


@dataclass(frozen=True)
class Offsets:
    """Offsets of the cameras.

    Attributes:
        frames: camera -> its delay in frames, relative to the median camera; cameras with an
            unknown offset are absent.
        correlation: camera -> mean correlation of its pairs at these offsets.
        gained: camera -> increase of this correlation over that without offsets.
        others: camera -> further offsets that fit almost as well, since motion may be periodic.
    """

    frames: Mapping[str, float]
    correlation: Mapping[str, float]
    gained: Mapping[str, float]
    others: Mapping[str, tuple[int, ...]]


def find_offsets(motion: Mapping[str, FloatArray], fps: float) -> Offsets:
    """Offsets of cameras by their motion signals (n,) each.

    The offsets maximise the sum of the correlations of all pairs by coordinate ascent over the
    cameras from zero. Among offsets of similar correlation the smaller is taken, since the steps of
    a walk look alike. Cameras whose correlation with the others is below LEAST_CORRELATION at the
    offsets found are left out.
    """
    names = [n for n, m in motion.items() if len(m) >= LEAST_FRAMES and m.mean() > _LEAST_MOTION]
    signals = {n: _varying(motion[n], fps) for n in names}
    most = int(min(MOST_LAG_S * fps, 0.4 * min((len(s) for s in signals.values()), default=0)))
    pairs: dict[tuple[str, str], FloatArray] = {}
    for a, b in combinations(names, 2):
        values = np.array(
            [_correlation(signals[a], signals[b], lag) for lag in range(-most, most + 1)]
        )
        if _is_evident(signals[a], signals[b], values, fps):
            pairs[a, b], pairs[b, a] = values, values[::-1]
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
    )


def _is_evident(a: FloatArray, b: FloatArray, correlations: FloatArray, fps: float) -> bool:
    """Whether two signals share so much motion that their correlations by lag tell the offset."""
    most = len(correlations) // 2
    best = int(np.argmax(correlations))
    if correlations[most] >= correlations[best] - _SIMILAR:
        best, least = most, LEAST_STILL
    else:
        least = LEAST_EVIDENCE
    common = min(len(a), len(b)) - abs(best - most)
    evidence = correlations[best] * np.sqrt(common * _independent_share(a, b, fps))
    return bool(correlations[best] >= LEAST_CORRELATION and evidence >= least)


def _independent_share(a: FloatArray, b: FloatArray, fps: float) -> float:
    """Share of the frames of two smooth signals that are independent (Bartlett's formula).

    Frames farther apart than `_STRIDE_S` count as independent, so that strides that look alike do.
    """
    count = min(len(a), len(b))
    lags = range(1, max(2, min(round(_STRIDE_S * fps), count // 3)))
    product = np.array([_correlation(a, a, lag) * _correlation(b, b, lag) for lag in lags])
    return float(1.0 / max(1.0, 1.0 + 2.0 * np.sum((1.0 - np.array(lags) / count) * product)))


def _totals(
    name: str,
    offsets: Mapping[str, int],
    pairs: Mapping[tuple[str, str], FloatArray],
    lags: NDArray[np.int_],
) -> FloatArray:
    """Mean correlation of a camera with the others, less a penalty, for each of its offsets."""
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
    """The best offset, to a fraction of a frame by a parabola."""
    best = int(np.argmax(totals))
    exact = float(lags[best])
    if 0 < best < len(totals) - 1:
        before, at, after = totals[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        exact += float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
    return exact


def _varying(motion: FloatArray, fps: float) -> FloatArray:
    """The signal without its slow trend, which would hide the lag."""
    signal = np.sqrt(np.maximum(motion[1:], 0.0))
    # Compression causes a peak at every key frame: peaks are clipped, and dips.
    signal = np.clip(signal, *np.quantile(signal, (0.02, 0.98)))
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
