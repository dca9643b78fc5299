"""Effect of the result filter: jitter of a standing person, lag of a moving one."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from markerless_tracker.benchmarks.with_truth import (
    Report,
    RunStart,
    no_report,
    open_with_truth,
    tracked_markers,
)
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.score import MM_PER_M
from markerless_tracker.tracking import TrackerConfig

SLOW_S = 1.0
"""Window of the moving average, s: the average is motion, the rest is jitter."""
MAX_LAG_FRAMES = 8.0
"""Greatest lag that is searched for, in frames."""
FILTERS = ("none", "one_euro")
"""Values of the setting `smoothing` that are compared."""

Points = NDArray[np.float64]


def measure_jitter(
    source: Path,
    config: TrackerConfig,
    *,
    start: RunStart,
    scale: float = 1.0,
    report: Report = no_report,
) -> dict[str, Any]:
    """Track a recording with a `ground_truth.trc` without and with the filter.

    Only the longest run of consecutive frames with a pose and reference markers is evaluated.

    Returns:
        `recording`, `start`, `scale`, `fps`, `frames`, `speed_m_s` (mean of the reference markers)
        and per filter (`none`, `one_euro`) `mean_mm`, `jitter_mm` (mean over the joints, see
        `jitter_mm`), `worst_jitter_mm`, `worst_joint`, `lag_frames` behind the unfiltered track
        (see `lag_frames`), `worst_lag_frames` (largest lag of a single joint).

    Raises:
        TrackerError: the recording cannot be read, has no truth, or `compared` finds nothing.
    """
    found: dict[str, Points] = {}
    with open_with_truth(source, config, scale=scale, report=report) as recording:
        for number, name in enumerate(FILTERS):
            results, truth = recording.run(replace(config, smoothing=name), start)
            found[name] = tracked_markers(results)
            report(f"runs on {recording.name}", number + 1, len(FILTERS))
    kept, names = compared(found["none"], truth, source)
    true = truth[kept][:, names]
    tracks = {name: points[kept][:, names] for name, points in found.items()}
    window = max(3, round(SLOW_S * recording.fps))
    return {
        "recording": recording.name,
        "source": str(source),
        "start": start.name,
        "scale": scale,
        "fps": recording.fps,
        "frames": len(true),
        "speed_m_s": float(np.linalg.norm(np.diff(true, axis=0), axis=2).mean() * recording.fps),
        **{
            name: _figures(points, tracks["none"], true, window, names)
            for name, points in tracks.items()
        },
    }


def compared(points: Points, truth: Points, source: Path) -> tuple[slice, NDArray[np.int64]]:
    """The longest run of frames with a pose and a truth, and the markers known in all of them.

    Args:
        points: (n, 15, 3) tracked markers; NaN in frames without a pose.
        truth: (n, 15, 3) reference markers; NaN where there are none.
        source: the recording, for messages.

    Raises:
        DatasetError: the truth has no marker in these frames, the run is shorter than four times
            `MAX_LAG_FRAMES`, or every marker is missing in a part of it.
    """
    known = np.asarray(np.isfinite(truth).all(axis=2))
    if not known.any():
        raise DatasetError(
            f"{source}: the truth of {len(truth)} frames has none of the markers, expected some of "
            f"{', '.join(MARKER_NAMES)}"
        )
    tracked = np.asarray(np.isfinite(points).all(axis=(1, 2)))
    kept = longest_true_run(np.asarray(tracked & known.any(axis=1)))
    count = kept.stop - kept.start
    if count < 4.0 * MAX_LAG_FRAMES:
        raise DatasetError(
            f"{source}: tracked for {count} frames in a row with a truth, expected "
            f"{4.0 * MAX_LAG_FRAMES:g} frames or more"
        )
    names = np.flatnonzero(known[kept].all(axis=0))
    if names.size == 0:
        raise DatasetError(
            f"{source}: no marker has a truth in all of the {count} frames compared, expected one "
            "or more"
        )
    return kept, names


def _figures(
    points: Points, unfiltered: Points, true: Points, window: int, names: NDArray[np.int64]
) -> Mapping[str, Any]:
    each = jitter_mm(points - true, window)
    worst = int(each.argmax())
    joints = range(points.shape[1])
    return {
        "mean_mm": float(np.linalg.norm(points - true, axis=2).mean() * MM_PER_M),
        "jitter_mm": float(each.mean()),
        "worst_jitter_mm": float(each[worst]),
        "worst_joint": MARKER_NAMES[int(names[worst])],
        "lag_frames": lag_frames(points, unfiltered),
        "worst_lag_frames": max(lag_frames(points[:, [j]], unfiltered[:, [j]]) for j in joints),
    }


def jitter_mm(points_m: Points, window: int) -> NDArray[np.float64]:
    """Jitter (m,) in mm of tracks (n, m, 3) in m: rms distance from their moving average.

    Offsets from the reference can be given instead of tracks, which excludes the person's true
    motion from the jitter.

    Args:
        points_m: tracks, or their offsets from the reference.
        window: length of the moving average in frames, centred; it is shortened symmetrically at
            both ends.
    """
    count = len(points_m)
    sums = np.concatenate([np.zeros((1, *points_m.shape[1:])), np.cumsum(points_m, axis=0)])
    index = np.arange(count)
    half = np.minimum(window // 2, np.minimum(index, count - 1 - index))
    widths = (2 * half + 1)[:, None, None]
    fast = points_m - (sums[index + half + 1] - sums[index - half]) / widths
    return np.asarray(np.sqrt((fast**2).sum(axis=2).mean(axis=0)) * MM_PER_M)


def lag_frames(points: Points, reference: Points) -> float:
    """Lag in frames of tracks (n, m, 3) behind reference tracks.

    The shift with the least squared differences; fractional (cubic interpolation), a constant
    offset of each coordinate ignored. Negative if the tracks run ahead.
    """
    count = len(points)
    times = np.arange(count)
    behind = CubicSpline(times, reference.reshape(count, -1))
    kept = times[int(MAX_LAG_FRAMES) : count - int(MAX_LAG_FRAMES)]
    flat = points.reshape(count, -1)[kept]

    def residual(shift: float) -> float:
        gap = flat - behind(kept - shift)
        return float(((gap - gap.mean(axis=0)) ** 2).sum())

    # Noise has many minima.
    whole = np.arange(-int(MAX_LAG_FRAMES), int(MAX_LAG_FRAMES) + 1)
    near = float(min(whole, key=lambda shift: residual(float(shift))))
    found = minimize_scalar(
        residual,
        bounds=(max(near - 1.0, -MAX_LAG_FRAMES), min(near + 1.0, MAX_LAG_FRAMES)),
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(found.x)


def longest_true_run(flags: NDArray[np.bool_]) -> slice:
    """Slice of the longest run of true values in (n,); empty without any."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    if edges.size == 0:
        return slice(0, 0)
    starts, ends = edges[::2], edges[1::2]
    longest = int((ends - starts).argmax())
    return slice(int(starts[longest]), int(ends[longest]))
