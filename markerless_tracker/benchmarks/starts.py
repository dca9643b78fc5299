"""How well the tracker starts by itself: from many frames of recordings whose truth is known."""

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.tables.accuracy import TRUTH
from markerless_tracker.benchmarks.tables.evidence import Evidence, make_evidence
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.body.anatomy import heading, turned_by
from markerless_tracker.datasets import MarkerTrack, open_recording, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Observation, TrackResult
from markerless_tracker.results.score import MM_PER_M, match_rows
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.tracker import Tracker

REACHED_MM = 80.0
"""A start whose last frame has a greater mean error has failed."""
WRONG_HEADING_DEG = 90.0


@dataclass(frozen=True)
class StartPlan:
    """What is measured.

    Attributes:
        config: every setting; the seed is overruled.
        every: a start from each so many-th frame that has a truth.
        frames: frames tracked from each; the last one is judged.
        seeds: seeds 0 .. seeds - 1.
    """

    config: TrackerConfig
    every: int = 10
    frames: int = 10
    seeds: int = 1


def measure_starts(
    source: Path,
    plan: StartPlan,
    *,
    stature_m: float | None,
    scale: float = 1.0,
    progress: Callable[[str, int, int | None], None] | None = None,
) -> dict[str, Any]:
    """Start from many frames of a recording with a `ground_truth.trc`, which only judges.

    Returns:
        The recording's figures (see `summarise`), and `starts`: one entry each.

    Raises:
        TrackerError: the recording cannot be read, has no truth or is too short.
    """
    report = progress or (lambda part, done, total: None)
    recording = open_recording(source, scale=scale)
    path = (source if source.is_dir() else source.parent) / TRUTH
    if not path.is_file():
        raise DatasetError(f"{source}: no {TRUTH}, expected one to judge by")
    reference = read_trc(path).with_pelvis()
    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
        evidence = make_evidence(
            recording,
            plan.config,
            Path(folder),
            progress=lambda n: report(f"evidence of {recording.name}", n, recording.frame_count),
        )
        truth = true_markers(evidence, reference)
        firsts = [
            k
            for k in range(0, len(truth) - plan.frames + 1, plan.every)
            if np.isfinite(truth[k + plan.frames - 1]).any()
        ]
        if not firsts:
            raise DatasetError(
                f"{source}: no {plan.frames} frames in a row with a truth, expected some"
            )
        frames = list(evidence.frames(every=1))
        starts = []
        total = len(firsts) * plan.seeds
        for seed in range(plan.seeds):
            config = replace(plan.config, seed=seed)
            tracker = build_tracker(evidence.rig, config, stature=stature_m).tracker
            tracker.warm_up()
            for first in firsts:
                figures = one_start(
                    tracker, frames[first : first + plan.frames], truth[first : first + plan.frames]
                )
                starts.append({"frame": first, "seed": seed, **figures})
                report(f"starts in {recording.name}", len(starts), total)
    return {
        "recording": recording.name,
        "source": str(source),
        "scale": scale,
        "stature_m": stature_m,
        "cameras": len(evidence.rig),
        **summarise(starts),
        "starts": starts,
    }


def one_start(
    tracker: Tracker,
    frames: Sequence[tuple[int, Mapping[str, Observation]]],
    truth: NDArray[np.float64],
) -> dict[str, Any]:
    """Start in the first of some frames (stamp, views) whose true markers (n, 15, 3) are known.

    Returns:
        `frame_mm`: mean error per frame, None without a pose; `heading_deg`: how far the last
        frame's heading is off; `turned`: whether it was turned round on the way; `first_pose_s`:
        time of the first step that gave a pose.
    """
    tracker.reset()
    errors: list[float | None] = []
    off: float | None = None
    turned, first_pose_s = False, None
    for (stamp_ns, views), true in zip(frames, truth, strict=True):
        began = time.perf_counter()
        result = tracker.step(views, stamp_ns)
        seconds = time.perf_counter() - began
        if result.pose is not None and first_pose_s is None:
            first_pose_s = seconds
        errors.append(error_mm(result, true))
        turned |= any("turned round" in warning for warning in result.warnings)
        off = None
        if result.markers_m is not None:
            angle = turned_by(heading(result.markers_m), heading(true))
            off = float(np.rad2deg(angle)) if np.isfinite(angle) else None
    return {
        "frame_mm": errors,
        "heading_deg": off,
        "turned": turned,
        "first_pose_s": first_pose_s,
    }


def summarise(starts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Figures over starts as `one_start` gives them.

    `count`; shares `found` (a pose in the last frame), `reached` (mean error at most `REACHED_MM`
    there), `wrong_heading` (more than `WRONG_HEADING_DEG` off there), `turned`; `mean_mm`,
    `median_mm`, `worst_mm` of the last frame and `first_mm`, the median of the first; median and
    greatest `first_pose_s`. None where no start gave a value.
    """
    last = [start["frame_mm"][-1] for start in starts]
    known = [value for value in last if value is not None]
    first = [start["frame_mm"][0] for start in starts if start["frame_mm"][0] is not None]
    headings = [start["heading_deg"] for start in starts if start["heading_deg"] is not None]
    seconds = [start["first_pose_s"] for start in starts if start["first_pose_s"] is not None]
    count = len(starts)
    return {
        "count": count,
        "found": len(known) / count,
        "reached": sum(value <= REACHED_MM for value in known) / count,
        "wrong_heading": sum(value > WRONG_HEADING_DEG for value in headings) / count,
        "turned": sum(start["turned"] for start in starts) / count,
        "first_mm": median(first) if first else None,
        "mean_mm": fmean(known) if known else None,
        "median_mm": median(known) if known else None,
        "worst_mm": max(known) if known else None,
        "first_pose_s": median(seconds) if seconds else None,
        "first_pose_max_s": max(seconds) if seconds else None,
    }


def true_markers(evidence: Evidence, reference: MarkerTrack) -> NDArray[np.float64]:
    """True markers (n, 15, 3) of the evidence's frames, NaN where there are none."""
    stamps = np.array(evidence.stamps_ns, dtype=np.int64)
    out = np.full((len(stamps), len(MARKER_NAMES), 3), np.nan)
    rows, of = match_rows(
        MarkerTrack(("none",), stamps, np.full((len(stamps), 1, 3), np.nan)), reference
    )
    for i, name in enumerate(MARKER_NAMES):
        if name in reference.names:
            out[rows, i] = reference.positions_m[of, reference.names.index(name)]
    return out


def error_mm(result: TrackResult, true: NDArray[np.float64]) -> float | None:
    """Mean distance (mm) of a result's markers from true ones (15, 3), over those there are."""
    if result.markers_m is None:
        return None
    gaps = np.linalg.norm(result.markers_m - true, axis=1)
    return float(np.nanmean(gaps)) * MM_PER_M if np.isfinite(gaps).any() else None
