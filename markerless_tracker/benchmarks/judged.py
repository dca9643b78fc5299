"""Recordings with a truth that only judges: whole runs on them, by any cameras and start."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.benchmarks.starts import true_markers
from markerless_tracker.benchmarks.tables.accuracy import TRUTH
from markerless_tracker.benchmarks.tables.evidence import Evidence, make_evidence
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import TrackResult
from markerless_tracker.tracking import TrackerConfig, build_tracker

Report = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class Beginning:
    """How a run begins.

    Attributes:
        measured: from the first row of the truth, which gives start and lengths, too; else by
            itself.
        stature_m: what is told of the person otherwise, None = nothing.
    """

    measured: bool = True
    stature_m: float | None = None

    @property
    def name(self) -> str:
        """For tables."""
        if self.measured:
            return "measured"
        return "automatic" if self.stature_m is None else f"automatic, {self.stature_m:g} m"


@dataclass(frozen=True, eq=False)
class Judged:
    """A recording's evidence and truth.

    Attributes:
        name: the recording's.
        fps: its rate.
        evidence: of all its cameras and frames.
        truth_m: (n, 15, 3) true markers, NaN where there is none.
        reference: the file of the truth.
    """

    name: str
    fps: float
    evidence: Evidence
    truth_m: NDArray[np.float64]
    reference: Path

    def run(
        self,
        config: TrackerConfig,
        beginning: Beginning,
        *,
        cameras: Sequence[str] | None = None,
    ) -> tuple[list[TrackResult], NDArray[np.float64]]:
        """Track it; results and true markers (n, 15, 3) from the frame of the start on.

        Args:
            config: every setting.
            beginning: how.
            cameras: names, None = all.

        Raises:
            TrackerError: the start does not fit, or an unknown camera.
        """
        rig = self.evidence.rig if cameras is None else self.evidence.rig.selected(cameras)
        setup = (
            build_tracker(rig, config, start_file=self.reference)
            if beginning.measured
            else build_tracker(rig, config, stature=beginning.stature_m)
        )
        setup.tracker.warm_up()
        least_ns = None
        if setup.start_stamp_ns is not None:
            least_ns = setup.start_stamp_ns - 0.5e9 / self.fps
        results, rows = [], []
        for row, (stamp_ns, views) in enumerate(self.evidence.frames(every=1)):
            if least_ns is not None and stamp_ns < least_ns:
                continue
            seen = {name: views[name] for name in rig.names}
            results.append(setup.tracker.step(seen, stamp_ns))
            rows.append(row)
        return results, self.truth_m[rows]


@contextmanager
def judged(
    source: Path, config: TrackerConfig, *, scale: float = 1.0, report: Report | None = None
) -> Iterator[Judged]:
    """A recording with a `ground_truth.trc`; its evidence lies in a folder that is removed.

    Args:
        source: the recording.
        config: settings of the imaging.
        scale: factor for the images.
        report: told what is done, how much of it, and of how much.

    Raises:
        TrackerError: the recording cannot be read or has no truth.
    """
    recording = open_recording(source, scale=scale)
    path = (source if source.is_dir() else source.parent) / TRUTH
    if not path.is_file():
        raise DatasetError(f"{source}: no {TRUTH}, expected one to judge by")
    reference = read_trc(path).with_pelvis()

    def observed(count: int) -> None:
        if report is not None:
            report(f"evidence of {recording.name}", count, recording.frame_count)

    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
        evidence = make_evidence(recording, config, Path(folder), progress=observed)
        truth = true_markers(evidence, reference)
        yield Judged(recording.name, recording.fps, evidence, truth, path)


def tracked_markers(results: Sequence[TrackResult]) -> NDArray[np.float64]:
    """Markers (n, 15, 3) in m of results, NaN without a pose."""
    nothing = np.full((len(MARKER_NAMES), 3), np.nan)
    return np.array([nothing if r.markers_m is None else r.markers_m for r in results])
