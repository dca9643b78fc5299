"""`view --node`: the output of a running tracker, until a signal or for a given time."""

import argparse
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path

import cv2
from rich.console import Console

from markerless_tracker.cli.terminal.bars import tell
from markerless_tracker.drawing import overlay_sheet
from markerless_tracker.drawing.overlay import Image
from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.viewing.live import LiveRecording
from markerless_tracker.viewing.rerun_file import require_rerun

NOTHING_RECEIVED = 3
"""Exit status if no message of a tracker arrived."""


def run_node(args: argparse.Namespace) -> int:
    """Show a running tracker; returns 0, or 3 if no message of one arrived.

    Raises:
        ConfigError: options that need a result, or no output to show it in.
        RosMissingError: ROS 2 is not installed.
    """
    of_results = (args.name, args.film, args.source, args.frames)
    if args.whole or any(value is not None for value in of_results):
        raise ConfigError(
            "--node shows a running tracker, "
            "expected no NAME, --film, --source, --frames and --whole"
        )
    shows = args.rrd is not None or args.sheet is None
    if shows:
        require_rerun()
    if args.sheet is None and args.rrd is None and not has_display():
        raise ConfigError("there is no display for the Rerun viewer, expected --sheet or --rrd")
    for path in (args.sheet, args.rrd):
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
    # Only this function imports ROS.
    from markerless_tracker.node.recorder.process import prepare
    from markerless_tracker.node.ros.process import StopSignals

    prepare()
    from markerless_tracker.node.spectator import Spectator

    results = 0
    any_received = False
    pictures: dict[str, Image] = {}
    with StopSignals() as stop, Spectator() as spectator:
        recording = LiveRecording(args.rrd) if shows else None
        tell(Console(stderr=True), "listening; Ctrl-C ends")
        for message in spectator.listen(until=lambda: stop.received, seconds=args.seconds):
            if message is None:
                continue
            any_received = True
            results += message.markers_m is not None
            pictures.update(message.pictures)
            if recording is not None:
                recording.arrange(spectator.cameras)
                recording.add(
                    message.stamp_ns,
                    markers_m=message.markers_m,
                    angles_rad=message.angles_rad,
                    overlap=message.overlap,
                    state=message.state,
                    pictures=message.pictures,
                )
        if recording is not None:
            recording.close()
    files = [args.rrd] if args.rrd is not None else []
    if args.sheet is not None and pictures:
        _write_sheet(args.sheet, pictures, args.width)
        files.append(args.sheet)
    if args.json:
        summary = {"files": [str(path) for path in files], "results": results}
        json.dump({**summary, "cameras": list(pictures)}, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        for path in files:
            print(path)
        print(f"{results} results, pictures of {', '.join(pictures) or 'no camera'}")
    if any_received:
        return 0
    tell(Console(stderr=True), "no tracker was heard: is it running, in this ROS_DOMAIN_ID?")
    return NOTHING_RECEIVED


def has_display() -> bool:
    """Whether there is a display for a window."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _write_sheet(path: Path, pictures: Mapping[str, Image], width_px: int) -> None:
    named = {name: pictures[name] for name in sorted(pictures)}
    if not cv2.imwrite(str(path), overlay_sheet(named, max_width_px=width_px)):
        raise DatasetError(f"{path}: cannot be written")
