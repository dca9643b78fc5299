"""Figures of a live tracker to which a recording is played at several rates."""

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markerless_tracker.bags import write_bag
from markerless_tracker.benchmarks.speed.cores import core_meter
from markerless_tracker.cli.replay.replay import Replay, replay
from markerless_tracker.datasets import MarkerTrack, Recording, open_recording, read_trc
from markerless_tracker.datasets.empty_scene import backgrounds_of
from markerless_tracker.datasets.truth import truth_path
from markerless_tracker.results.score import score
from markerless_tracker.tracking import TrackerConfig

Report = Callable[[str, int, int | None], None]
"""Receives progress: the part in words, its steps done, and their total."""


@dataclass(frozen=True)
class LivePlan:
    """The settings of a measurement.

    Attributes:
        config: settings of the tracker.
        rates: sets per second at which the recording is played.
        start_given: start with the first row of the recording's reference markers, if it has any.
    """

    config: TrackerConfig
    rates: Sequence[float]
    start_given: bool = True


def measure_live(
    source: Path,
    plan: LivePlan,
    *,
    stature_m: float | None = None,
    scale: float = 1.0,
    report: Report,
) -> list[dict[str, Any]]:
    """Play a recording to a tracker, each in its own process over ROS 2, once per rate.

    Args:
        source: the recording; it is written as a bag to a temporary folder.
        plan: the settings of the measurement.
        stature_m: stature given to the tracker if nothing else is, m; None = unknown.
        scale: factor for the images.
        report: receives progress.

    Returns:
        Per rate: `source`, `rate` (sets/s), `start` (`given` or `nothing given`), `sets` sent,
        `played_s` (time the player took), `tracked` (sets with a pose), `per_second` (of them),
        `skipped`, `lost`, `first_pose_s`, `latency_ms` {median, p95} from the arrival of a set's
        last image to its publication, `cpu_ms` {tracker, player} per tracked and per sent set,
        `mean_mm`, the error of the tracked sets, and `reference_us` and `cores_at_once`, the speed
        of the cores just before (`CoreSpeed`). Unknown values are None.

    Raises:
        NodeError: a process failed.
        TrackerError: the recording cannot be read.
    """
    recording = open_recording(source, scale=scale)
    reference = truth_path(source)
    truth = read_trc(reference) if reference.is_file() else None
    given = plan.start_given and truth is not None
    with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as name, core_meter() as meter:
        folder = Path(name)
        sets = _convert(recording, folder / "bag", report)
        tracker: dict[str, object] = {
            **_parameters(plan.config),
            "calibration_file": folder / "bag" / "calibration.toml",
            "background_dir": folder / "bag" / "background",
            **({"start_file": reference} if given else {}),
            **({"stature": stature_m} if stature_m is not None and not given else {}),
        }
        rows = []
        for number, rate in enumerate(plan.rates):
            title = f"{recording.name} at {rate:g} sets/s"

            def tell(doing: str, done: int, title: str = title) -> None:
                report(f"{title}: {doing}", done, sets)

            cores = meter()
            run = replay(
                folder / "bag",
                sets=sets,
                rate=rate / recording.fps,
                fps=recording.fps,
                tracker=tracker,
                result=folder / f"run{number}",
                log_dir=folder / "log",
                report=tell,
            )
            start = "given" if given else "nothing given"
            rows.append(
                {
                    "source": str(source),
                    "rate": rate,
                    "start": start,
                    **_row(run, truth),
                    "reference_us": cores.reference_us,
                    "cores_at_once": cores.at_once,
                }
            )
    return rows


def _convert(recording: Recording, bag: Path, report: Report) -> int:
    """Write the bag; returns its number of sets."""
    name, total = recording.name, recording.frame_count
    report(f"backgrounds of {name}", 0, None)
    backgrounds = backgrounds_of(recording)

    def tell(done: int, _: int | None) -> None:
        report(f"{name} as a bag", done, total)

    return write_bag(recording, bag, backgrounds=backgrounds, progress=tell).sets


def _parameters(config: TrackerConfig) -> dict[str, object]:
    """The settings that differ from the defaults."""
    defaults = TrackerConfig().by_name()
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in config.by_name().items()
        if value != defaults[name]
    }


def _row(run: Replay, truth: MarkerTrack | None) -> dict[str, Any]:
    path = run.result.with_name(run.result.name + ".trc")
    track = read_trc(path) if path.is_file() else None
    tracked = 0 if track is None else int(track.tracked.sum())
    error_mm = score(track, truth).mean_mm if track and tracked and truth else math.nan
    return {
        "sets": run.sets,
        "played_s": _or_none(run.playing_s),
        "tracked": tracked,
        "per_second": _or_none(tracked / run.playing_s) if run.playing_s else None,
        "skipped": run.skipped,
        "lost": run.lost,
        "first_pose_s": _or_none(run.first_pose_s),
        "latency_ms": {
            "median": _or_none(run.latency_median_ms),
            "p95": _or_none(run.latency_p95_ms),
        },
        "cpu_ms": {
            "tracker": _or_none(1e3 * run.tracker_cpu_s / tracked) if tracked else None,
            "player": _or_none(run.player_cpu_ms),
        },
        "mean_mm": _or_none(error_mm),
    }


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
