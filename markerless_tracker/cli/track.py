"""Verb `track`: a recording or bag to a result, without a ROS graph."""

import argparse
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from markerless_tracker.camera.calibration import write_calibration
from markerless_tracker.datasets import Recording, open_recording
from markerless_tracker.errors import ConfigError
from markerless_tracker.records import TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.results.run import recording_backgrounds, track_recording
from markerless_tracker.tracking import OPTIMIZERS, PRESETS, TrackerConfig, build_tracker
from markerless_tracker.tracking.camera_check import CameraCheck, Shift, corrected, describe
from markerless_tracker.viewing.debug_images import DebugImages

HELP = (
    "Track the person in a recording folder, a Pose2Sim project or a bag, as fast as it goes, and "
    "write NAME.trc (15 markers, metres) and NAME.json (settings, state, fitness, parameters)."
)
EXAMPLE = "markerless_tracker track RECORDING -o out/walk --stature 1.75"

_KEYS = ("optimizer", "body", "evaluations", "seed", "threads")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("source", type=Path, help="recording folder, Pose2Sim project or bag")
    parser.add_argument(
        "-o", dest="name", type=Path, required=True, metavar="NAME", help="result without suffix"
    )
    parser.add_argument(
        "--start", type=Path, metavar="TRC|YAML", help="start pose; default: found by itself"
    )
    parser.add_argument("--subject", type=Path, metavar="FILE", help="subject file")
    parser.add_argument(
        "--subject-from", type=Path, metavar="TRC", help="measure the subject on its first row"
    )
    parser.add_argument(
        "--stature", type=float, metavar="M", help="a generic person of that height"
    )
    parser.add_argument(
        "--optimizer",
        metavar="NAME",
        help=f"search algorithm: {', '.join(OPTIMIZERS)} (default sppso)",
    )
    parser.add_argument("--body", metavar="NAME|FILE", help="body description")
    parser.add_argument(
        "--evaluations",
        type=int,
        metavar="N",
        help="evaluations per frame (default: the optimizer's own)",
    )
    parser.add_argument("--preset", choices=tuple(PRESETS), help="tuned (default) or paper")
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument(
        "--fps", type=float, metavar="N", help="keep every k-th frame from the start"
    )
    parser.add_argument(
        "--scale", type=float, default=1.0, metavar="S", help="factor for the images"
    )
    parser.add_argument(
        "--background",
        type=Path,
        metavar="DIR",
        help="empty-scene images, or learned backgrounds (.npz), per camera",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="seed of all random draws")
    parser.add_argument("--threads", type=int, metavar="N", help="0 (default) = one per core")
    parser.add_argument(
        "--debug-images",
        type=Path,
        metavar="DIR",
        help="per frame and camera: input, background, foreground and shadow, silhouette, edges, "
        "body",
    )
    parser.add_argument(
        "--refine-calibration",
        type=Path,
        metavar="OUT.toml",
        help="write the calibration with cameras that disagree with the others corrected",
    )
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Do it; returns the exit status."""
    console = Console(stderr=True)
    config = read_config(args.config, _flags(args))
    recording = open_recording(args.source, scale=args.scale)
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=console,
    ) as bars:  # fmt: skip
        task = bars.add_task("background", total=None)
        setup = build_tracker(
            recording.rig,
            config,
            backgrounds=recording_backgrounds(recording, config, args.background),
            start_file=args.start,
            subject_file=args.subject,
            subject_from=args.subject_from,
            stature=args.stature,
        )
        bars.update(task, description="compiling")
        setup.tracker.warm_up()
        bars.update(task, description=f"tracking {recording.name}")
        rate = args.fps or recording.fps
        debug = DebugImages(args.debug_images) if args.debug_images else None
        states: dict[str, int] = {}
        writer = ResultWriter(
            args.name, setup.tracker.body, config, fps=rate, source=recording.name
        )
        started = time.perf_counter()
        frames = 0
        check = CameraCheck(setup.tracker.rig, config)
        with writer:
            for tracked in track_recording(recording, setup, fps=args.fps):
                writer.add(tracked.result)
                writer.body = setup.tracker.body
                check.add(tracked.result, setup.tracker.body)
                state = tracked.result.state.value
                states[state] = states.get(state, 0) + 1
                if debug:
                    tracker = setup.tracker
                    debug.write(
                        tracked.images,
                        tracked.result,
                        tracker.rig,
                        tracker.body,
                        tracker.segmenter,
                    )
                frames += 1
                bars.update(
                    task, completed=frames, total=_total(recording, setup.start_stamp_ns, rate)
                )
            shifts = check.shifts()
            cameras = _cameras(shifts)
            writer.note({"cameras": cameras})
        seconds = time.perf_counter() - started
    if args.refine_calibration is not None:
        full = open_recording(args.source).rig
        write_calibration(args.refine_calibration, corrected(full, shifts, args.scale))
    for warning in (*recording.warnings, *describe(shifts)):
        console.print(f"warning: {warning}", markup=False, highlight=False, soft_wrap=True)
    summary: dict[str, Any] = {
        "source": str(args.source),
        "result": str(writer.trc_path),
        "frames": frames,
        "states": states,
        "seconds": round(seconds, 3),
        "frames_per_s": round(frames / seconds, 2) if seconds > 0 else None,
        "warnings": [*recording.warnings, *describe(shifts)],
        "cameras": cameras,
    }
    if args.json:
        json.dump(summary, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        lost = states.get(TrackState.LOST.value, 0)
        print(
            f"{writer.trc_path}: {frames} frames, {lost} of them lost, "
            f"{summary['frames_per_s']} frames/s"
        )
    return 0


def read_config(path: Path | None, flags: dict[str, Any]) -> TrackerConfig:
    """Settings of a YAML file, overruled by flags that were given, by dotted name.

    Raises:
        ConfigError: the file cannot be read, or a setting is unknown or impossible.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            first = str(error).splitlines()[0]
            raise ConfigError(f"{path}: cannot read the settings: {first}") from error
        if loaded is not None and not isinstance(loaded, dict):
            raise ConfigError(
                f"{path}: expected a mapping of settings, got {type(loaded).__name__}"
            )
        values = TrackerConfig.dotted(loaded or {})
    return TrackerConfig.from_mapping({**values, **TrackerConfig.dotted(flags)})


def _cameras(shifts: Mapping[str, Shift]) -> dict[str, Any]:
    """How far each camera's silhouettes lie from the body, for JSON."""
    return {
        name: {
            "shift_px": [round(value, 2) for value in shift.px],
            "shift_mm": round(1000.0 * shift.length_m, 1),
            "checks": shift.checks,
            "disagrees": shift.disagrees,
        }
        for name, shift in shifts.items()
    }


def _flags(args: argparse.Namespace) -> dict[str, Any]:
    named = {key: getattr(args, key) for key in (*_KEYS, "preset")}
    return {key: value for key, value in named.items() if value is not None}


def _total(recording: Recording, start_stamp_ns: int | None, rate: float) -> int | None:
    if recording.frame_count is None:
        return None
    start = 0 if start_stamp_ns is None else recording.start_index(start_stamp_ns)
    return -(-(recording.frame_count - start) // max(1, round(recording.fps / rate)))
