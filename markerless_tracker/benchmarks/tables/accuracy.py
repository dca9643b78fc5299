"""Tables of accuracy: configurations x rates x seeds on recordings with reference markers."""

import csv
import json
import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean, median, stdev
from typing import Any

from markerless_tracker.benchmarks.tables.cluster import run_all_on
from markerless_tracker.benchmarks.tables.evidence import EvidenceOrder
from markerless_tracker.benchmarks.tables.fingerprint import file_key, recording_key, run_key
from markerless_tracker.benchmarks.tables.pool import run_all
from markerless_tracker.benchmarks.tables.runs import Run, describe
from markerless_tracker.benchmarks.tables.variants import variants
from markerless_tracker.body import load_description
from markerless_tracker.datasets import (
    Recording,
    every_for_fps,
    existing_truth,
    open_recording,
)
from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.setup import first_row

COLUMNS = (
    "recording", "optimizer", "preset", "body", "refinement", "variant", "fps",
    "start_noise_mm", "seeds", "evaluations", "refinements", "mean_mm", "sd_mm", "max_mm",
    "worst_joint_mm", "limbs_mm", "limbs_sd_mm", "last_joint_mm", "lost_run", "truth_difference",
    "frames_per_s", "ms_per_evaluation", "frames",
)  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Content of a table.

    Attributes:
        configs: one per row and rate; their seeds and threads are replaced.
        rates: frames per second; each must divide the recordings' rates. () = those of 60 and 20
            that a recording allows, otherwise its own rate.
        seeds: seeds 0 .. seeds - 1.
        scale: factor for the images.
        start_noise_mm: sd of the noise on the first row of markers.
        truth_score: also compute f(truth) - f(result).
        frames: number of frames of a recording, from its start on; None = all.
        jobs: number of parallel processes.
        scheduler: address of a Dask scheduler whose workers do the runs; None = this machine.
    """

    configs: tuple[TrackerConfig, ...]
    rates: tuple[float, ...] = ()
    seeds: int = 6
    scale: float = 1.0
    start_noise_mm: float = 0.0
    truth_score: bool = False
    frames: int | None = None
    jobs: int = 1
    scheduler: str | None = None


class Progress:
    """Receives the progress of `make_table`; the base class ignores it."""

    def observing(self, recording: str, done: int, total: int | None) -> None:
        """Receives the number of frame sets of a recording that have been segmented."""

    def running(self, done: int, total: int) -> None:
        """Receives the number of completed runs, stored ones included."""

    def warn(self, message: str) -> None:
        """Receives a warning for the user, one line."""


def make_table(
    sources: Sequence[Path],
    plan: Plan,
    *,
    store: Path | None = None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run a plan on recordings; returns a row per recording, configuration and rate.

    Args:
        sources: recordings, each with a `ground_truth.trc`.
        plan: what to run.
        store: folder for one small file per run; runs found there are not repeated.
        progress: receives the progress.

    Returns:
        Rows as `summarise` makes them.

    Raises:
        ConfigError: the store is a recording.
        TrackerError: a recording has no truth or cannot be read, or a run failed.
    """
    progress = progress or Progress()
    for config in plan.configs:
        # Unknown bodies fail before the first long computation.
        load_description(config.body)
    for source in sources:
        if store is not None and store.resolve() == source.resolve():
            raise ConfigError(
                f"{store}: the recording itself, expected another folder for the runs"
            )
    pieces = [_Piece(source, plan, store) for source in sources]
    total = sum(len(piece.runs) for piece in pieces)
    rows: list[dict[str, Any]] = []
    done = 0
    for piece in pieces:
        found: dict[int, dict[str, Any]] = {}
        for number, key in enumerate(piece.keys):
            stored = _stored(store, piece.recording.name, key)
            if stored is not None:
                found[number] = stored
        done += len(found)
        progress.running(done, total)
        for numbers in piece.groups():
            missing = [number for number in numbers if number not in found]
            if not missing:
                continue
            for index, figures in piece.run(missing, progress):
                number = missing[index]
                found[number] = figures
                _store(store, piece, number, figures)
                done += 1
                progress.running(done, total)
        for warning in piece.recording.warnings:
            progress.warn(warning)
        rows.extend(piece.rows(found))
    return rows


class _Piece:
    """A plan's runs on one recording."""

    def __init__(self, source: Path, plan: Plan, store: Path | None) -> None:
        self.plan = plan
        self.source = source
        self.recording: Recording = open_recording(source, scale=plan.scale)
        # Workers have another working directory.
        self.reference = existing_truth(source).resolve()
        self.start = self.recording.start_index(first_row(self.reference).stamp_ns)
        self.rates = _rates(self.recording.fps, plan.rates)
        self.runs = [
            Run(
                config=replace(config, seed=seed, threads=1),
                every=every_for_fps(self.recording.fps, rate),
                reference=self.reference,
                start_noise_mm=plan.start_noise_mm,
                truth_score=plan.truth_score,
            )
            for config in plan.configs
            for rate in self.rates
            for seed in range(plan.seeds)
        ]
        self.key = recording_key(source, without=store)
        self.keys = [
            run_key(
                {
                    **describe(run),
                    "recording": self.key,
                    "reference": file_key(self.reference),
                    "body": file_key(Path(run.config.body)),
                    "scale": plan.scale,
                    "frames": plan.frames,
                }
            )
            for run in self.runs
        ]

    def groups(self) -> Iterable[list[int]]:
        """Numbers of the runs that use the same evidence."""
        groups: dict[tuple[Any, ...], list[int]] = {}
        for number, run in enumerate(self.runs):
            # A background that follows the light depends on the images that it has seen.
            followed = run.every if run.config.background.follow_s > 0.0 else None
            groups.setdefault((followed, *_imaging(run.config)), []).append(number)
        return groups.values()

    def run(
        self, numbers: Sequence[int], progress: Progress
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Index in `numbers` and figures of runs on the same evidence, in order of completion."""
        runs = [self.runs[number] for number in numbers]
        order = EvidenceOrder(
            # A worker has another working directory.
            self.source.resolve(),
            self.plan.scale,
            runs[0].config,
            self.start,
            math.gcd(*(run.every for run in runs)),
            self.plan.frames,
            self.key,
        )
        if self.plan.scheduler is not None:
            yield from run_all_on(self.plan.scheduler, runs, order)
            return
        total = None
        if self.recording.frame_count is not None:
            left = self.recording.frame_count - self.start
            total = -(-min(left, self.plan.frames or left) // order.every)
        name = self.recording.name
        with tempfile.TemporaryDirectory(prefix="markerless_tracker_") as folder:
            evidence = order.make(
                Path(folder),
                recording=self.recording,
                progress=lambda count: progress.observing(name, count, total),
            )
            yield from run_all(runs, evidence, processes=self.plan.jobs)

    def rows(self, found: Mapping[int, dict[str, Any]]) -> Iterator[dict[str, Any]]:
        numbers = iter(range(len(self.runs)))
        names = variants(self.plan.configs)
        for place, config in enumerate(self.plan.configs):
            for rate in self.rates:
                figures = [found[next(numbers)] for _ in range(self.plan.seeds)]
                yield {
                    "recording": self.recording.name,
                    "source": str(self.source),
                    "scale": self.plan.scale,
                    "optimizer": config.optimizer,
                    "preset": config.preset,
                    "body": config.body,
                    "refinement": config.refinement,
                    "variant": names[place],
                    "configuration": place,
                    "fps": rate,
                    "start_noise_mm": self.plan.start_noise_mm,
                    **summarise(figures),
                }


def summarise(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One row from the runs of its seeds.

    Means over the seeds: `mean_mm`, `limbs_mm` (with the sd between seeds, None for one seed),
    `evaluations`, `refinements`, `truth_difference`, `joints`; each over the seeds that have it.
    Maxima over the seeds: `max_mm` (largest frame mean), `worst_joint_mm`, `last_joint_mm`,
    `lost_run`, `lost_frames`.
    `frames_per_s` is the median over the seeds; `ms_per_evaluation` follows from it for runs
    without refinement (None with refinement). `runs` holds each seed's `mean_mm`, `curve` the error
    over time: the stamps common to all seeds (s) and the mean over the seeds (mm).
    """
    row: dict[str, Any] = {"seeds": len(runs)}
    for name in ("evaluations", "refinements", "mean_mm", "limbs_mm", "truth_difference"):
        values = [run[name] for run in runs if run[name] is not None]
        row[name] = fmean(values) if values else None
        if name in ("mean_mm", "limbs_mm"):
            row[name.replace("_mm", "_sd_mm")] = stdev(values) if len(values) > 1 else None
    row["sd_mm"] = row.pop("mean_sd_mm")
    for name in ("max_mm", "worst_joint_mm", "last_joint_mm", "lost_run", "lost_frames"):
        row[name] = max(run[name] for run in runs)
    row["frames_per_s"] = median(run["frames_per_s"] for run in runs)
    alone = not row["refinements"] and row["evaluations"]
    row["ms_per_evaluation"] = 1e3 / (row["frames_per_s"] * row["evaluations"]) if alone else None
    row["frames"] = min(run["frames"] for run in runs)
    row["joints"] = {
        name: fmean(values)
        for name in dict.fromkeys(name for run in runs for name in run["joints"])
        if (values := [run["joints"][name] for run in runs if run["joints"].get(name) is not None])
    }
    row["runs"] = [run["mean_mm"] for run in runs]
    row["curve"] = _curve(runs)
    return row


def _curve(runs: Sequence[Mapping[str, Any]]) -> dict[str, list[float]]:
    errors = [dict(zip(run["stamps_s"], run["frame_mm"], strict=True)) for run in runs]
    shared = sorted(set.intersection(*map(set, errors)))
    return {"s": shared, "mean_mm": [fmean(error[s] for error in errors) for s in shared]}


def write_table(folder: Path, table: Mapping[str, Any]) -> None:
    """Write table.json (everything) and table.csv (`COLUMNS` of its `rows`) into a folder.

    Raises:
        OSError: it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(table, indent=1, allow_nan=False) + "\n"
    (folder / "table.json").write_text(text, encoding="utf-8")
    with (folder / "table.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(table["rows"])


def _rates(fps: float, wanted: tuple[float, ...]) -> tuple[float, ...]:
    if wanted:
        return wanted
    return tuple(rate for rate in (60.0, 20.0) if _allows(fps, rate)) or (fps,)


def _allows(fps: float, rate: float) -> bool:
    """Whether every k-th frame of a recording gives a rate."""
    try:
        every_for_fps(fps, rate)
    except ConfigError:
        return False
    return True


def _imaging(config: TrackerConfig) -> tuple[Any, ...]:
    values = config.by_name()
    return tuple(values[entry.name] for entry in ImagingSettings.settings())


def _file(store: Path, recording: str, key: str) -> Path:
    return store / "runs" / f"{recording}-{key}.json"


def _stored(store: Path | None, recording: str, key: str) -> dict[str, Any] | None:
    if store is None:
        return None
    try:
        text = _file(store, recording, key).read_text(encoding="utf-8")
        return dict(json.loads(text)["figures"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _store(store: Path | None, piece: _Piece, number: int, figures: Mapping[str, Any]) -> None:
    if store is None:
        return
    path = _file(store, piece.recording.name, piece.keys[number])
    path.parent.mkdir(parents=True, exist_ok=True)
    record = {"source": str(piece.source), **describe(piece.runs[number]), "figures": figures}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    # An interrupted write leaves no incomplete file.
    os.replace(part, path)
