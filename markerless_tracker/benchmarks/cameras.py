"""Error with fewer cameras: whole runs with every subset of a recording's cameras."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.tables.runs import lost_run
from markerless_tracker.benchmarks.with_truth import (
    Report,
    RunStart,
    no_report,
    open_with_truth,
    tracked_markers,
)
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.results.score import MM_PER_M
from markerless_tracker.tracking import TrackerConfig

SETTLED_FRAMES = 30
"""Frames at the beginning of a run with an automatic start that are not scored."""


def measure_cameras(
    source: Path,
    config: TrackerConfig,
    *,
    starts: Sequence[RunStart],
    counts: Sequence[int] = (3, 2),
    scale: float = 1.0,
    report: Report = no_report,
) -> dict[str, Any]:
    """Track a recording with a `ground_truth.trc` with all its cameras and with subsets of them.

    Args:
        source: the recording.
        config: every setting.
        starts: each subset is run once with each.
        counts: sizes of the subsets; all subsets of these sizes are run.
        scale: factor for the images.
        report: receives progress.

    Returns:
        `recording`, `source`, `scale`, and `runs`: per start and subset `start`, `cameras`
        (names), the figures of `score_run`, and `ratio`: its mean error over that of all cameras.

    Raises:
        TrackerError: the recording cannot be read, has no truth, too few cameras, or no
            frame that is scored after an automatic start.
    """
    runs: list[dict[str, Any]] = []
    with open_with_truth(source, config, scale=scale, report=report) as recording:
        names = recording.evidence.rig.names
        if not all(0 < count < len(names) for count in counts):
            raise ConfigError(
                f"{source}: {', '.join(map(str, counts))} of {len(names)} cameras, expected "
                f"fewer than {len(names)}"
            )
        scored = np.isfinite(recording.truth_m[SETTLED_FRAMES:]).any()
        if not scored and not all(start.measured for start in starts):
            raise DatasetError(
                f"{source}: {len(recording.truth_m)} frames, expected some with a truth after the "
                f"first {SETTLED_FRAMES}, which are not scored after an automatic start"
            )
        subsets = [names, *(c for count in counts for c in combinations(names, count))]
        for start in starts:
            skipped = 0 if start.measured else SETTLED_FRAMES
            of_all = None
            for subset in subsets:
                results, truth = recording.run(config, start, cameras=subset)
                figures = score_run(tracked_markers(results)[skipped:], truth[skipped:])
                if subset is names:
                    of_all = figures["mean_mm"]
                ratio = figures["mean_mm"] / of_all if of_all and figures["mean_mm"] else None
                runs.append(
                    {"start": start.name, "cameras": list(subset), **figures, "ratio": ratio}
                )
                report(f"runs on {recording.name}", len(runs), len(subsets) * len(starts))
    return {"recording": recording.name, "source": str(source), "scale": scale, "runs": runs}


def score_run(points_m: NDArray[np.float64], truth_m: NDArray[np.float64]) -> dict[str, Any]:
    """Errors of tracked markers (n, 15, 3) against reference markers, m; NaN where there is none.

    `mean_mm`, `max_mm`: mean and maximum of the frames' mean errors, None without any pose;
    `worst_joint_mm`; `lost_run` (see `runs.lost_run`) of the frames with a reference; `found`:
    fraction of them that have a pose.
    """
    apart_mm: NDArray[np.float64] = np.linalg.norm(points_m - truth_m, axis=2) * MM_PER_M
    known = np.asarray(np.isfinite(truth_m).all(axis=2)).any(axis=1)
    seen = np.asarray(np.isfinite(apart_mm).any(axis=1))
    lost = lost_run(apart_mm[known])
    if not seen.any():
        return {"mean_mm": None, "max_mm": None, "worst_joint_mm": None, "lost_run": lost,
                "found": 0.0}  # fmt: skip
    frame_mm = np.nanmean(apart_mm[seen], axis=1)
    return {
        "mean_mm": float(frame_mm.mean()),
        "max_mm": float(frame_mm.max()),
        "worst_joint_mm": float(np.nanmax(apart_mm)),
        "lost_run": lost,
        "found": float(seen.sum() / known.sum()),
    }
