"""One run of a table: a configuration on a recording's evidence, scored by its reference."""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.tables.evidence import Evidence
from markerless_tracker.benchmarks.tables.truth import TruthScore
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import MarkerTrack, read_trc, write_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.results.score import MM_PER_M, score
from markerless_tracker.tracking import TrackerConfig, build_tracker

LOST_LIMB_MM = 150.0
"""A joint with a larger error counts as a lost limb."""


@dataclass(frozen=True)
class Run:
    """Arguments of a run.

    Attributes:
        config: every setting, the seed included.
        every: every k-th frame of the recording is tracked.
        reference: marker file; its first row gives the start pose and the segment lengths, all its
            rows are the reference.
        start_noise_mm: sd of normal noise on each coordinate of that first row.
        truth_score: also compare f at the reference pose with f at the result.
    """

    config: TrackerConfig
    every: int
    reference: Path
    start_noise_mm: float = 0.0
    truth_score: bool = False


def execute(run: Run, evidence: Evidence) -> dict[str, Any]:
    """Track and score; returns plain values for JSON.

    Keys: those of `Score.as_dict`, and `stamps_s` (of `frame_mm`), `last_joint_mm` (largest joint
    error in the last frame), `lost_run` (of the frames compared, which have a pose),
    `lost_frames` (frames in the state LOST), `evaluations` and `refinements`
    (means per frame), `frames_per_s` (of `Tracker.step` on given evidence, without the first frame,
    which fits the shape), `truth_difference` (None without `truth_score`).

    Raises:
        TrackerError: the start does not fit the body, or no frame has a reference.
    """
    reference = read_trc(run.reference)
    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
        start = run.reference
        if run.start_noise_mm > 0.0:
            start = Path(folder) / "start.trc"
            write_trc(start, disturbed_start(reference, run.start_noise_mm, run.config.seed), 60.0)
        tracker = build_tracker(evidence.rig, run.config, start_file=start).tracker
    tracker.warm_up()
    truth: TruthScore | None = None
    if run.truth_score:
        stamps = evidence.stamps_ns[:: run.every // evidence.every]
        truth = TruthScore(tracker, reference, np.array(stamps, dtype=np.int64))
    results: list[TrackResult] = []
    seconds: list[float] = []
    for stamp_ns, views in evidence.frames(every=run.every):
        began = time.perf_counter()
        result = tracker.step(views, stamp_ns)
        seconds.append(time.perf_counter() - began)
        if truth is not None:
            truth.add(result)
        results.append(result)
    figures = score(_track(results), reference)
    return {
        **figures.as_dict(),
        "stamps_s": (figures.stamps_ns * 1e-9).round(6).tolist(),
        "last_joint_mm": float(np.nanmax(figures.joint_mm[-1])),
        "lost_run": lost_run(figures.joint_mm),
        "lost_frames": sum(result.state is TrackState.LOST for result in results),
        "evaluations": float(np.mean([result.evaluations for result in results])),
        "refinements": float(np.mean([result.refinements for result in results])),
        "frames_per_s": 1.0 / float(np.mean(seconds[1:] or seconds)),
        "truth_difference": truth.mean if truth is not None and truth.differences else None,
    }


def disturbed_start(reference: MarkerTrack, noise_mm: float, seed: int) -> MarkerTrack:
    """The first row with markers, with normal noise of sd `noise_mm` on each coordinate.

    Raises:
        DatasetError: no row has any marker.
    """
    rows = np.flatnonzero(reference.tracked)
    if rows.size == 0:
        raise DatasetError("the reference has no marker in any row, expected at least one")
    first = reference.rows(rows[:1])
    rng = keyed_generator(seed, int(first.stamps_ns[0]), "start noise")
    noise_m = noise_mm / MM_PER_M * rng.standard_normal(first.positions_m.shape)
    return MarkerTrack(first.names, first.stamps_ns, first.positions_m + noise_m)


def lost_run(joint_mm: NDArray[np.float64]) -> int:
    """Longest run of frames without a pose, or with any joint more than `LOST_LIMB_MM` off.

    Args:
        joint_mm: (n, m) errors of the frames with a reference; NaN where a joint has no reference,
            in all joints of a frame without a pose.
    """
    tracked = np.isfinite(joint_mm).any(axis=1)
    return longest_run(np.asarray(~tracked | (joint_mm > LOST_LIMB_MM).any(axis=1)))


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Length of the longest run of true values in (n,)."""
    best = length = 0
    for flag in flags.tolist():
        length = length + 1 if flag else 0
        best = max(best, length)
    return best


def _track(results: list[TrackResult]) -> MarkerTrack:
    nothing = np.full((len(MARKER_NAMES), 3), np.nan)
    found = [nothing if r.markers_m is None else r.markers_m for r in results]
    return MarkerTrack(
        MARKER_NAMES,
        np.array([r.stamp_ns for r in results], dtype=np.int64),
        np.array(found).reshape(len(found), len(MARKER_NAMES), 3),
    )


def describe(run: Run) -> Mapping[str, Any]:
    """All arguments that a run's numbers depend on, as JSON values."""
    return {
        "settings": run.config.as_mapping(),
        "every": run.every,
        "start_noise_mm": run.start_noise_mm,
        "truth_score": run.truth_score,
    }
