"""Recordings with reference markers: the evidence of all frames, the truth, runs to compare."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.tables.evidence import Evidence, make_evidence
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import (
    MarkerTrack,
    Recording,
    existing_truth,
    open_recording,
    read_trc,
)
from markerless_tracker.records import TrackResult
from markerless_tracker.results.score import MM_PER_M, match_rows
from markerless_tracker.tracking import TrackerConfig, build_tracker

Report = Callable[[str, int, int | None], None]
"""Receives progress: the part in words, its steps done, and their total (None if unknown)."""


def no_report(part: str, done: int, total: int | None) -> None:
    """Ignore progress."""


@dataclass(frozen=True)
class RunStart:
    """The start of a run.

    Attributes:
        measured: start pose and segment lengths from the first row of the reference; otherwise
            the tracker starts automatically.
        stature_m: stature given to an automatic start, m; None = unknown.
    """

    measured: bool = True
    stature_m: float | None = None

    @property
    def name(self) -> str:
        """Name in tables."""
        if self.measured:
            return "measured"
        return "automatic" if self.stature_m is None else f"automatic, {self.stature_m:g} m"


@dataclass(frozen=True, eq=False)
class RecordingWithTruth:
    """A recording's evidence and reference markers.

    Attributes:
        recording: the recording.
        evidence: observations of all cameras and frames.
        truth_m: (n, 15, 3) reference markers per frame, m, world frame; NaN where there are none.
        reference: the file that the markers were read from.
    """

    recording: Recording
    evidence: Evidence
    truth_m: NDArray[np.float64]
    reference: Path

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def fps(self) -> float:
        """Frame rate, 1/s."""
        return self.recording.fps

    def run(
        self, config: TrackerConfig, start: RunStart, *, cameras: Sequence[str] | None = None
    ) -> tuple[list[TrackResult], NDArray[np.float64]]:
        """Track the recording from the frame of the start on.

        Args:
            config: every setting.
            start: start pose and sizes.
            cameras: names of the cameras used, None = all.

        Returns:
            The results, and the reference markers (n, 15, 3) of the same frames, m.

        Raises:
            DatasetError: the recording has no frame within half a frame of the start.
            TrackerError: the start does not fit the body, or a camera is unknown.
        """
        rig = self.evidence.rig if cameras is None else self.evidence.rig.selected(cameras)
        setup = (
            build_tracker(rig, config, start_file=self.reference)
            if start.measured
            else build_tracker(rig, config, stature=start.stature_m)
        )
        least_ns = None
        if setup.start_stamp_ns is not None:
            # Raises where there is no such frame.
            self.recording.start_index(setup.start_stamp_ns)
            least_ns = setup.start_stamp_ns - 0.5e9 / self.fps
        setup.tracker.warm_up()
        results, rows = [], []
        for row, (stamp_ns, views) in enumerate(self.evidence.frames(every=1)):
            if least_ns is not None and stamp_ns < least_ns:
                continue
            seen = {name: views[name] for name in rig.names}
            results.append(setup.tracker.step(seen, stamp_ns))
            rows.append(row)
        return results, self.truth_m[rows]


@contextmanager
def open_with_truth(
    source: Path, config: TrackerConfig, *, scale: float = 1.0, report: Report = no_report
) -> Iterator[RecordingWithTruth]:
    """Open a recording that has a `ground_truth.trc` and segment all its frames.

    The evidence lies in a temporary folder that is removed at the end of the context.

    Args:
        source: the recording.
        config: settings of the imaging.
        scale: factor for the images.
        report: receives progress.

    Raises:
        TrackerError: the recording cannot be read or has no `ground_truth.trc`.
    """
    recording = open_recording(source, scale=scale)
    path = existing_truth(source)
    reference = read_trc(path).with_pelvis()
    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
        evidence = make_evidence(
            recording,
            config,
            Path(folder),
            progress=lambda n: report(f"evidence of {recording.name}", n, recording.frame_count),
        )
        truth = true_markers(evidence, reference)
        yield RecordingWithTruth(recording, evidence, truth, path)


def true_markers(evidence: Evidence, reference: MarkerTrack) -> NDArray[np.float64]:
    """Reference markers (n, 15, 3) of the evidence's frames, m; NaN where there are none."""
    stamps = np.array(evidence.stamps_ns, dtype=np.int64)
    out = np.full((len(stamps), len(MARKER_NAMES), 3), np.nan)
    rows, of = match_rows(
        MarkerTrack(("none",), stamps, np.full((len(stamps), 1, 3), np.nan)), reference
    )
    for i, name in enumerate(MARKER_NAMES):
        if name in reference.names:
            out[rows, i] = reference.positions_m[of, reference.names.index(name)]
    return out


def tracked_markers(results: Sequence[TrackResult]) -> NDArray[np.float64]:
    """Markers (n, 15, 3) of results, m; NaN in frames without a pose."""
    nothing = np.full((len(MARKER_NAMES), 3), np.nan)
    found = [nothing if r.markers_m is None else r.markers_m for r in results]
    return np.array(found).reshape(-1, len(MARKER_NAMES), 3)


def error_mm(result: TrackResult, true: NDArray[np.float64]) -> float | None:
    """Mean distance in mm of a result's markers from the reference (15, 3) in m.

    Markers without a reference (NaN) are left out; None without a pose or any reference.
    """
    if result.markers_m is None:
        return None
    gaps = np.linalg.norm(result.markers_m - true, axis=1)
    return float(np.nanmean(gaps)) * MM_PER_M if np.isfinite(gaps).any() else None
