"""Verb `track`: tracks the person in a recording or bag and writes a result, without ROS."""

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rich.console import Console

from markerless_tracker.body import load_description
from markerless_tracker.calibration.contours.frames import FrameChoice
from markerless_tracker.calibration.contours.refine import Refinement, refine_cameras
from markerless_tracker.calibration.contours.report import describe_refinement
from markerless_tracker.camera.calibration import write_calibration
from markerless_tracker.camera.doubts import calibration_doubts
from markerless_tracker.cli.passes.first import set_up
from markerless_tracker.cli.terminal.bars import tell, warn
from markerless_tracker.cli.terminal.notices import COMPILING, Bars, Notices
from markerless_tracker.cli.track_arguments import add_arguments, reading_options
from markerless_tracker.compiled import compilation
from markerless_tracker.datasets import Recording, every_for_fps, open_recording
from markerless_tracker.datasets.in_step import InStepRecording, read_time_offsets
from markerless_tracker.datasets.silhouettes import SilhouetteRecording
from markerless_tracker.errors import CalibrationError, ConfigError, DatasetError
from markerless_tracker.results.appended import make_folder_of
from markerless_tracker.results.result import ResultWriter, check_target
from markerless_tracker.results.run import frames_to_track, track_recording
from markerless_tracker.results.smooth import Smoothing, smooth_result
from markerless_tracker.results.verdict.record import RunRecord
from markerless_tracker.results.verdict.verdict import Verdict, verdict_of
from markerless_tracker.tracking import TrackerConfig, TrackerSetup
from markerless_tracker.tracking.cameras.check import Shift, describe
from markerless_tracker.viewing.debug_images import DebugImages

HELP = (
    "Track the person in a recording folder, a Pose2Sim project or a bag, without ROS. Writes "
    "NAME.trc (15 markers, metres), NAME.json (settings, and per frame state, fitness, parameters "
    "and warnings) and NAME.subject.yaml (the sizes of the body). The start pose and the stature "
    "are optional: without them both are estimated. Exit status 3: no person was found."
)
EXAMPLE = "markerless_tracker track recordings/walk -o out/walk --stature 1.75"

__all__ = ["EXAMPLE", "HELP", "add_arguments", "read_config", "run"]

NO_PERSON_FOUND = 3
"""Exit status if the person was tracked in no frame."""

_KEYS = ("optimizer", "body", "evaluations", "seed", "threads")


def run(args: argparse.Namespace) -> int:
    """Track; returns 0, or 3 if no person was found.

    Raises:
        CalibrationError: the requested refinement of the calibration failed; the result is
            complete.
    """
    console = Console(stderr=True)
    with Bars(console) as bars:
        finished = track_source(args, bars)
    verdict = finished.outcome.verdict
    # The verdict's lines contain the other warnings.
    for warning in finished.late_warnings if args.json else finished.recording.warnings:
        warn(console, warning)
    if args.json:
        print(json.dumps(finished.summary, indent=2))
    else:
        print(
            f"{finished.outcome.trc_path}: {verdict.counts}, "
            f"{finished.outcome.frames_per_s} frames/s"
            + (f"; {finished.filled} frames filled" if finished.filled else "")
        )
        for line in verdict.lines():
            print(line)
        if isinstance(finished.refined, Refinement):
            print(f"{args.refine_calibration}:")
            for line in describe_refinement(finished.refined):
                print(f"  {line}")
    if verdict.tracked:
        if isinstance(finished.refined, CalibrationError):
            raise CalibrationError(
                f"{args.refine_calibration}: not written: {finished.refined}"
            ) from finished.refined
        return 0
    tell(
        console,
        f"no person was found in {verdict.frames} of {verdict.frames} frames; no subject file was "
        "written",
    )
    return NO_PERSON_FOUND


@dataclass(frozen=True)
class Finished:
    """A finished run of `track_source`.

    Attributes:
        recording: the tracked recording.
        outcome: the outcome over all frames.
        filled: interpolated frames, None without smoothing.
        refined: the refined calibration, or the error of the refinement; None if not requested.
        late_warnings: warnings known only at the end, one line each.
        summary: summary of the run, for JSON.
    """

    recording: Recording
    outcome: "Outcome"
    filled: int | None
    refined: Refinement | CalibrationError | None
    late_warnings: tuple[str, ...]
    summary: Mapping[str, Any]


def track_source(args: argparse.Namespace, notices: Notices) -> Finished:
    """Run `track` with its parsed arguments, and write the result's files.

    Args:
        args: parsed arguments (`add_arguments`).
        notices: receives the progress and the warnings.

    Raises:
        TrackerError: an argument is impossible, or a file cannot be read or written.
    """
    config = read_config(args.config, given_settings(args))
    check_target(args.name, overwrite=args.force, allow="--force")
    if args.refine_calibration is not None:
        if args.refine_calibration.exists() and not args.force:
            raise DatasetError(
                f"{args.refine_calibration}: exists already, expected a new name or --force"
            )
        make_folder_of(args.refine_calibration)
    smoothing = None
    if args.smooth is not None or args.fill_gaps is not None:
        smoothing = Smoothing(args.smooth, args.fill_gaps or 0.0)
    recording = _opened(args, args.scale)
    if smoothing is not None:
        smoothing.check_rate(recording.fps / every_for_fps(recording.fps, args.fps))
    offsets_s = None if args.time_offsets is None else read_time_offsets(args.time_offsets)
    if offsets_s is not None:
        recording = InStepRecording(recording, offsets_s)
    if args.masks is not None:
        if args.debug_images is not None:
            raise ConfigError("--debug-images shows the segmentation, which --masks replaces")
        if args.background is not None:
            raise ConfigError("--background is for the segmentation, which --masks replaces")
        recording = SilhouetteRecording(recording, args.masks)
    doubts = calibration_doubts(recording.rig)
    for doubt in doubts:
        notices.warn(doubt)
    notices.begin("background")
    setup = set_up(args, recording, config, notices)
    with closing(setup.tracker.evidence) as evidence:
        evidence.start_process()
        notices.begin(COMPILING)
        with compilation(lambda _, done, most: notices.step(done, most)):
            setup.tracker.warm_up()
        notices.begin(f"tracking {recording.name}", frames_to_track(recording, setup, args.fps))
        choice = None if args.refine_calibration is None else FrameChoice()
        outcome = _track(args, recording, setup, config, doubts, notices, choice, offsets_s)
    filled = refined = None
    verdict = outcome.verdict
    if smoothing is not None and verdict.tracked:
        filled = smooth_result(args.name, smoothing)
    if choice is not None:
        notices.begin("refining the calibration", 1)
        refined = _refined(args, recording, setup, choice)
        notices.step(1)
    late = [*recording.warnings, *describe(outcome.shifts)]
    if verdict.frames_with_warnings:
        late.append(
            f"{verdict.frames_with_warnings} of {verdict.frames} frames have warnings, "
            f"of {verdict.kinds}"
        )
    summary = _summary(args, recording, outcome)
    if filled is not None:
        summary["filled"] = filled
    if isinstance(refined, Refinement):
        summary["calibration"] = {"path": str(args.refine_calibration), **refined.as_mapping()}
    elif refined is not None:
        summary["calibration"] = {"path": None, "refused": str(refined)}
    return Finished(recording, outcome, filled, refined, tuple(late), summary)


def _refined(
    args: argparse.Namespace, recording: Recording, setup: TrackerSetup, choice: FrameChoice
) -> Refinement | CalibrationError:
    """Refine the calibration and write it; returns the error if the refinement failed."""
    tracker = setup.tracker
    try:
        refinement = refine_cameras(
            recording.rig, tracker.body, tracker.config, choice.chosen(), scale=args.scale
        )
    except CalibrationError as error:
        return error
    write_calibration(args.refine_calibration, refinement.applied(_opened(args, 1.0).rig))
    return refinement


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run over all frames.

    Attributes:
        trc_path: the marker file.
        seconds: duration of tracking.
        shifts: camera -> offset of its silhouettes from the body.
        record: statistics over the frames.
        verdict: the verdict on them.
    """

    trc_path: Path
    seconds: float
    shifts: Mapping[str, Shift]
    record: RunRecord
    verdict: Verdict

    @property
    def frames_per_s(self) -> float | None:
        """Frames per second of tracking; None if the measured duration is 0."""
        return round(self.record.frames / self.seconds, 2) if self.seconds > 0 else None


def _opened(args: argparse.Namespace, scale: float) -> Recording:
    return open_recording(args.source, scale=scale, **reading_options(args))


def _track(
    args: argparse.Namespace,
    recording: Recording,
    setup: TrackerSetup,
    config: TrackerConfig,
    doubts: Sequence[str],
    notices: Notices,
    choice: FrameChoice | None,
    offsets_s: Mapping[str, float] | None,
) -> Outcome:
    """Track all frames and write the result and the debug images."""
    tracker, description = setup.tracker, load_description(config.body)
    debug = DebugImages(args.debug_images) if args.debug_images else None
    record = RunRecord(tracker.rig)
    started = time.perf_counter()
    with ResultWriter(
        args.name,
        tracker.body,
        config,
        fps=recording.fps / every_for_fps(recording.fps, args.fps),
        source=str(args.source.resolve()),
        overwrite=args.force,
        keep_lost=args.keep_lost,
    ) as writer:
        interrupted: tuple[str, ...] = ()
        try:
            for tracked in track_recording(recording, setup, fps=args.fps):
                result, body = tracked.result, tracker.body
                writer.add(result)
                writer.body = body
                if choice is not None:
                    choice.add(result)
                for kind in record.add(result, body, tracked.images.index):
                    notices.warn(f"frame {kind.first_frame}: {kind.text}")
                if debug:
                    debug.write(tracked.images, result, tracker.rig, body, tracker.segmenter)
                notices.pose(result.state, result.iou.values())
                notices.step(record.frames)
        except KeyboardInterrupt:
            interrupted = (f"interrupted after {record.frames} frames: the rest is missing",)
            notices.warn(interrupted[0])
        seconds = time.perf_counter() - started
        shifts = tracker.shifts
        verdict = verdict_of(
            record,
            description,
            known=(*interrupted, *doubts, *describe(shifts)),
            start_given=args.start is not None,
        )
        writer.note({"cameras": _cameras(shifts), "verdict": verdict.as_mapping()})
        writer.note({"recording": recording.name})
        writer.note({"scale": args.scale, "reading": reading_options(args)})
        if offsets_s is not None:
            writer.note({"time_offsets_s": dict(offsets_s)})
    if interrupted:
        raise KeyboardInterrupt
    return Outcome(writer.trc_path, seconds, shifts, record, verdict)


def _summary(args: argparse.Namespace, recording: Recording, outcome: Outcome) -> dict[str, Any]:
    return {
        "source": str(args.source),
        "result": str(outcome.trc_path),
        "frames": outcome.record.frames,
        "tracked": outcome.record.tracked,
        "states": dict(outcome.record.states),
        "seconds": round(outcome.seconds, 3),
        "frames_per_s": outcome.frames_per_s,
        "verdict": outcome.verdict.as_mapping(),
        "warnings": [*recording.warnings, *describe(outcome.shifts)],
        "frame_warnings": outcome.record.warnings.as_list(),
        "cameras": _cameras(outcome.shifts),
    }


def read_config(path: Path | None, flags: dict[str, Any]) -> TrackerConfig:
    """Settings of a YAML file, overridden by the given flags (dotted name -> value).

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown or impossible.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
            stated = error.strerror if isinstance(error, OSError) else None
            reason = stated or " ".join(str(error).split())
            raise ConfigError(f"{path}: cannot read the settings: {reason}") from error
        if loaded is not None and not isinstance(loaded, dict):
            raise ConfigError(
                f"{path}: expected a mapping of settings, got {type(loaded).__name__}"
            )
        try:
            values = TrackerConfig.dotted(loaded or {})
            TrackerConfig.from_mapping(values)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error
    return TrackerConfig.from_mapping({**values, **TrackerConfig.dotted(flags)})


def _cameras(shifts: Mapping[str, Shift]) -> dict[str, Any]:
    """Offset of each camera's silhouettes from the body, for JSON."""
    return {name: shift.as_mapping() for name, shift in shifts.items()}


def given_settings(args: argparse.Namespace) -> dict[str, Any]:
    """The given arguments that are settings."""
    named = {key: getattr(args, key) for key in (*_KEYS, "preset")}
    return {key: value for key, value in named.items() if value is not None}
