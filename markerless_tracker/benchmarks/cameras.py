"""What fewer cameras cost: whole runs with every choice of some of a recording's cameras."""

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.judged import Beginning, Report, judged, tracked_markers
from markerless_tracker.benchmarks.tables.runs import LOST_LIMB_MM, longest_run
from markerless_tracker.errors import ConfigError
from markerless_tracker.results.score import MM_PER_M
from markerless_tracker.tracking import TrackerConfig

SETTLED_FRAMES = 30
"""Frames at the beginning of a run without a start that are not judged."""


def measure_cameras(
    source: Path,
    config: TrackerConfig,
    *,
    beginnings: Sequence[Beginning],
    counts: Sequence[int] = (3, 2),
    scale: float = 1.0,
    report: Report | None = None,
) -> dict[str, Any]:
    """Track a recording with a `ground_truth.trc` by all its cameras and by fewer.

    Args:
        source: the recording.
        config: every setting.
        beginnings: each gives a run per choice.
        counts: numbers of cameras; every choice of as many is run.
        scale: factor for the images.
        report: told what is done, how much of it, and of how much.

    Returns:
        `recording`, `source`, `scale`, and `runs`: per beginning and choice `start`, `cameras`
        (names), and the figures of `judge`; `ratio`: its mean error over that of all cameras.

    Raises:
        TrackerError: the recording cannot be read, has no truth or too few cameras.
    """
    runs: list[dict[str, Any]] = []
    with judged(source, config, scale=scale, report=report) as recording:
        names = recording.evidence.rig.names
        if not all(0 < count < len(names) for count in counts):
            raise ConfigError(
                f"{source}: {', '.join(map(str, counts))} of {len(names)} cameras, expected "
                f"fewer than {len(names)}"
            )
        choices = [names, *(c for count in counts for c in combinations(names, count))]
        for beginning in beginnings:
            skipped = 0 if beginning.measured else SETTLED_FRAMES
            usual = None
            for choice in choices:
                results, truth = recording.run(config, beginning, cameras=choice)
                figures = judge(tracked_markers(results)[skipped:], truth[skipped:])
                if choice is names:
                    usual = figures["mean_mm"]
                ratio = figures["mean_mm"] / usual if usual and figures["mean_mm"] else None
                runs.append(
                    {"start": beginning.name, "cameras": list(choice), **figures, "ratio": ratio}
                )
                if report is not None:
                    total = len(choices) * len(beginnings)
                    report(f"runs on {recording.name}", len(runs), total)
    return {"recording": recording.name, "source": str(source), "scale": scale, "runs": runs}


def judge(points_m: NDArray[np.float64], truth_m: NDArray[np.float64]) -> dict[str, Any]:
    """Figures of tracked markers (n, 15, 3) beside true ones, NaN where there is none.

    `mean_mm`, `max_mm` (mean and greatest of the frames' mean errors, None without any),
    `worst_joint_mm`, `lost_run` (longest run of frames with any joint more than `LOST_LIMB_MM`
    off), `found` (share of the frames with a truth that have a pose).
    """
    apart_mm: NDArray[np.float64] = np.linalg.norm(points_m - truth_m, axis=2) * MM_PER_M
    known = np.asarray(np.isfinite(truth_m).all(axis=2)).any(axis=1)
    seen = np.asarray(np.isfinite(apart_mm).any(axis=1))
    if not seen.any():
        return {"mean_mm": None, "max_mm": None, "worst_joint_mm": None, "lost_run": 0,
                "found": 0.0}  # fmt: skip
    frame_mm = np.nanmean(apart_mm[seen], axis=1)
    return {
        "mean_mm": float(frame_mm.mean()),
        "max_mm": float(frame_mm.max()),
        "worst_joint_mm": float(np.nanmax(apart_mm)),
        "lost_run": longest_run(np.asarray((apart_mm > LOST_LIMB_MM).any(axis=1))),
        "found": float(seen.sum() / known.sum()),
    }
