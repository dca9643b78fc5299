"""Verb `compile`: compiles the kernels for this machine in advance."""

import argparse
import json
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from markerless_tracker.calibration.contours.time_offset import TimeOffsetEstimate
from markerless_tracker.camera import CameraRig
from markerless_tracker.cli.terminal.arguments import list_of
from markerless_tracker.cli.terminal.bars import progress_bars
from markerless_tracker.cli.track import read_config
from markerless_tracker.compiled import compilation
from markerless_tracker.imaging import learn_background
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.config import OPTIMIZERS

HELP = (
    "Compile for this machine, at install time for example. Without it each program compiles at "
    "its first start what it needs, which takes half a minute. Repeated, it compiles only what "
    "is out of date."
)
EXAMPLE = "markerless_tracker compile --optimizer sppso,hmcpso"

_SIZE_PX = (160, 120)
_BACKGROUNDS = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--optimizer",
        type=list_of(_optimizer),
        default=OPTIMIZERS,
        metavar="LIST",
        help=f"search algorithms, some of {', '.join(OPTIMIZERS)} (default: all of them)",
    )
    parser.add_argument("--body", metavar="NAME", help="body model (default: the settings')")
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings (YAML)")
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Compile; returns the exit status.

    Raises:
        ConfigError: a setting is unknown or impossible.
    """
    began_s = time.monotonic()
    given = {} if args.body is None else {"body": args.body}
    plans = [read_config(args.config, {**given, "optimizer": name}) for name in args.optimizer]
    compiled = 0
    with progress_bars() as bars:
        task = bars.add_task("compiling", total=None)
        for plan in plans:
            for channels in (3, 1):

                def show(name: str, done: int, most: int, plan: TrackerConfig = plan) -> None:
                    text = f"compiling for {plan.optimizer}: {name}"
                    bars.update(task, description=text, completed=done, total=most)

                with compilation(show) as counted:
                    warm_up(plan, channels)
                compiled += counted.done
    seconds = time.monotonic() - began_s
    if args.json:
        summary = {"compiled": compiled, "seconds": round(seconds, 1)}
        json.dump({**summary, "optimizers": list(args.optimizer)}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        print(f"{compiled} kernels compiled in {seconds:.0f} s")
    return 0


def warm_up(config: TrackerConfig, channels: int) -> None:
    """Compile the kernels of a tracker with these settings, for images with 1 or 3 channels."""
    rig: CameraRig = ring_rig(3, _SIZE_PX)
    shape = (_SIZE_PX[1], _SIZE_PX[0], 3)[: 2 if channels == 1 else 3]
    rng = np.random.default_rng(0)
    backgrounds = {
        name: learn_background(
            [rng.integers(90, 110, shape, dtype=np.uint8) for _ in range(_BACKGROUNDS)],
            config,
            camera=name,
        )
        for name in rig.names
    }
    tracker = build_tracker(rig, config, backgrounds=backgrounds).tracker
    # An interruption must not leave the segmenting process behind.
    with closing(tracker.evidence) as evidence:
        evidence.start_process()
        tracker.warm_up()
        TimeOffsetEstimate(rig, step_px=config.edges.step_px).warm_up(tracker.body)


def _optimizer(text: str) -> str:
    if text not in OPTIMIZERS:
        raise argparse.ArgumentTypeError(f"{text!r}, expected some of {', '.join(OPTIMIZERS)}")
    return text
