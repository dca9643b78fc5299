"""Automatic starts from many frames of recordings with reference markers."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.with_truth import (
    Report,
    error_mm,
    no_report,
    open_with_truth,
)
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Observation
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.tracker import Tracker

SUCCESS_MM = 80.0
"""A start has succeeded if the mean error of its last frame is at most this."""
WRONG_HEADING_DEG = 90.0
"""A heading further off than this counts as wrong."""


@dataclass(frozen=True)
class StartPlan:
    """Which starts are measured.

    Attributes:
        config: every setting; the seed is replaced.
        every: start from every k-th frame.
        frames: frames tracked from each start; the last one is scored.
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
    report: Report = no_report,
) -> dict[str, Any]:
    """Start automatically from many frames of a recording with a `ground_truth.trc`.

    Args:
        source: the recording.
        plan: which starts.
        stature_m: stature given to the start, m; None = unknown.
        scale: factor for the images.
        report: receives progress.

    Returns:
        The recording's figures (see `summarise`), and `starts`: one entry each.

    Raises:
        TrackerError: the recording cannot be read, has no truth or is too short.
    """
    with open_with_truth(source, plan.config, scale=scale, report=report) as recording:
        truth = recording.truth_m
        firsts = [
            k
            for k in range(0, len(truth) - plan.frames + 1, plan.every)
            if np.isfinite(truth[k + plan.frames - 1]).any()
        ]
        if not firsts:
            raise DatasetError(
                f"{source}: no {plan.frames} frames in a row with a truth, expected some"
            )
        frames = list(recording.evidence.frames(every=1))
        starts = []
        for seed in range(plan.seeds):
            config = replace(plan.config, seed=seed)
            tracker = build_tracker(recording.evidence.rig, config, stature=stature_m).tracker
            tracker.warm_up()
            for first in firsts:
                span = slice(first, first + plan.frames)
                figures = one_start(tracker, frames[span], truth[span])
                starts.append({"frame": first, "seed": seed, **figures})
                report(f"starts in {recording.name}", len(starts), len(firsts) * plan.seeds)
    return {
        "recording": recording.name,
        "source": str(source),
        "scale": scale,
        "stature_m": stature_m,
        "cameras": len(recording.evidence.rig),
        **summarise(starts),
        "starts": starts,
    }


def one_start(
    tracker: Tracker,
    frames: Sequence[tuple[int, Mapping[str, Observation]]],
    truth: NDArray[np.float64],
) -> dict[str, Any]:
    """Start automatically in the first of some frames.

    Args:
        tracker: the tracker; it is reset.
        frames: n frames, stamp (ns) and views.
        truth: (n, 15, 3) their reference markers, m.

    Returns:
        `frame_mm`: mean error per frame, None without a pose; `heading_deg`: error of the last
        frame's heading; `heading_corrected`: whether the tracker changed to the
        opposite heading; `first_pose_s`: computing time of the first step that gave a pose.
    """
    tracker.reset()
    errors: list[float | None] = []
    off: float | None = None
    corrected, first_pose_s = False, None
    for (stamp_ns, views), true in zip(frames, truth, strict=True):
        began = time.perf_counter()
        result = tracker.step(views, stamp_ns)
        seconds = time.perf_counter() - began
        if result.pose is not None and first_pose_s is None:
            first_pose_s = seconds
        errors.append(error_mm(result, true))
        corrected |= any("turned round" in warning for warning in result.warnings)
        off = None
        if result.markers_m is not None:
            angle = heading_difference(heading(result.markers_m), heading(true))
            off = float(np.rad2deg(angle)) if np.isfinite(angle) else None
    return {
        "frame_mm": errors,
        "heading_deg": off,
        "heading_corrected": corrected,
        "first_pose_s": first_pose_s,
    }


def summarise(starts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Figures over starts as `one_start` gives them.

    `count`; fractions of the starts: `found` (a pose in the last frame), `succeeded` (its mean
    error is at most `SUCCESS_MM`), `wrong_heading` (its heading is more than `WRONG_HEADING_DEG`
    off), `heading_corrected`; `mean_mm`, `median_mm`, `worst_mm` of the last frame and `first_mm`,
    the median of the first; median and maximum of `first_pose_s`. None where no start gave a value.
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
        "succeeded": sum(value <= SUCCESS_MM for value in known) / count,
        "wrong_heading": sum(value > WRONG_HEADING_DEG for value in headings) / count,
        "heading_corrected": sum(start["heading_corrected"] for start in starts) / count,
        "first_mm": median(first) if first else None,
        "mean_mm": fmean(known) if known else None,
        "median_mm": median(known) if known else None,
        "worst_mm": max(known) if known else None,
        "first_pose_s": median(seconds) if seconds else None,
        "first_pose_max_s": max(seconds) if seconds else None,
    }
