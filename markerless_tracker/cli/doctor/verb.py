"""Arguments and output of `doctor`."""

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

from markerless_tracker.camera import CameraRig, read_calibration
from markerless_tracker.camera.doubts import calibration_doubts
from markerless_tracker.checks.finding import GREEN, RED, YELLOW, Finding
from markerless_tracker.checks.machine import check_machine
from markerless_tracker.checks.stream import CameraStream, check_streams
from markerless_tracker.cli.check import print_findings
from markerless_tracker.cli.terminal.arguments import list_of
from markerless_tracker.cli.terminal.bars import seconds_bar
from markerless_tracker.datasets.background import read_background, read_background_models
from markerless_tracker.errors import ConfigError, TrackerError
from markerless_tracker.imaging import Image
from markerless_tracker.node.ros.process import RosMissingError, StopSignals, require_ros
from markerless_tracker.node.ros.profile import USERS_OWN, apply_profile, profile_file

HELP = (
    "Check this machine and its cameras: shared memory, socket buffers, threads, ROS, profile of "
    "the middleware, calibration, and of each camera that is sending rate, jitter, age and offset "
    "of the stamps, sharpness, exposure, and whether the background is still the scene. Red lines "
    "say what to do; exit status 3 if there is one."
)
EXAMPLE = "markerless_tracker doctor --calibration walk/calibration.toml"
_ADVICE = "correct it, or make it anew with `calibrate`"
MOST_SECONDS = 3600.0
"""Largest value of `--seconds`."""
IMAGE_TOPIC = "NAME/image_raw"
_NAMELESS = Finding(
    "cameras", YELLOW, "", "/image_raw has no camera name, expected NAME/image_raw",
    "give the driver a namespace",
)  # fmt: skip
_NONE_OFFERED = Finding(
    "cameras", YELLOW, "", "no topic NAME/image_raw is offered",
    "start the cameras, or name them (--cameras, --image-topic)",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--calibration", type=Path, metavar="FILE", help="calibration.toml")
    parser.add_argument(
        "--background", type=Path, metavar="DIR", help="the empty scene, with --calibration"
    )
    parser.add_argument(
        "--cameras", metavar="A,B,...", type=list_of(str), default=(),
        help="cameras to listen to (those of --calibration, else all that send)",
    )  # fmt: skip
    parser.add_argument(
        "--image-topic", default=IMAGE_TOPIC, metavar="TOPIC",
        help="topic of the images, NAME stands for the camera",
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=float, default=3.0, metavar="S",
        help="how long the cameras are listened to (default 3); 0: not at all",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(args: argparse.Namespace) -> int:
    """Check; returns 0, or 3 if a finding is red.

    Raises:
        ConfigError: arguments are impossible, or contradict each other.
    """
    if not 0.0 <= args.seconds <= MOST_SECONDS:
        raise ConfigError(f"--seconds is {args.seconds:g}, expected 0 to {MOST_SECONDS:g}")
    if args.background is not None and args.calibration is None:
        raise ConfigError("--background needs --calibration, whose cameras it is compared with")
    if "NAME" not in args.image_topic:
        raise ConfigError(f"--image-topic is {args.image_topic!r}, expected NAME in it")
    if args.image_topic != IMAGE_TOPIC and not args.cameras and args.calibration is None:
        raise ConfigError(
            "--image-topic needs the names of the cameras, expected --cameras or --calibration"
        )
    # The user's environment is copied first, since listening applies the shipped profile.
    found = check_machine(dict(os.environ), profiles=USERS_OWN, shipped=profile_file())
    rig, calibrated = _calibration(args.calibration)
    found += calibrated
    backgrounds, missing = _backgrounds(args.background, rig)
    found += missing
    joins = all(one.state != RED for one in found if one.check == "discovery")
    if args.seconds > 0.0 and joins:
        found += _cameras(args.cameras or (rig.names if rig else ()), backgrounds, args)
    return print_findings(found, "doctor", as_json=args.json)


def _calibration(file: Path | None) -> tuple[CameraRig | None, list[Finding]]:
    name = "calibration"
    if file is None:
        return None, [Finding(name, GREEN, "", "not given (--calibration FILE): not checked")]
    try:
        rig = read_calibration(file)
    except TrackerError as error:
        advice = "give the file's path" if not file.is_file() else _ADVICE
        return None, [Finding(name, RED, "", str(error), advice)]
    doubts = calibration_doubts(rig)
    if not doubts:
        return rig, [Finding(name, GREEN, "", f"{len(rig)} cameras, plausible")]
    return rig, [
        Finding(name, RED, "", doubt.removeprefix("calibration: "), _ADVICE) for doubt in doubts
    ]


def _backgrounds(
    folder: Path | None, rig: CameraRig | None
) -> tuple[dict[str, Image], list[Finding]]:
    if folder is None or rig is None:
        return {}, []
    advice = "put an image of the scene without the person there, NAME.png for each camera"
    try:
        models = read_background_models(folder, rig, ignore_others=True)
        frames = read_background(folder, rig, ignore_others=True)
    except TrackerError as error:
        return {}, [Finding("background", RED, "", str(error), advice)]
    images = {name: pictures[0] for name, pictures in frames.items()}
    images |= {name: model.image for name, model in models.items()}
    return images, [
        Finding("background", RED, name, f"{folder} holds none", advice)
        for name in rig.names
        if name not in images
    ]


def _cameras(
    names: Sequence[str], backgrounds: dict[str, Image], args: argparse.Namespace
) -> list[Finding]:
    # Only this function imports ROS.
    from markerless_tracker.node.doctor.listen import image_topics, listen

    bars = seconds_bar()
    try:
        apply_profile()
        require_ros()
        from markerless_tracker.node.ros.declared import check_topics

        check_topics("--image-topic", args.image_topic, names)
        with StopSignals() as stop, bars:
            offered = names or image_topics(stop)
            if stop.received:
                raise KeyboardInterrupt
            names = [name for name in offered if name]
            found = [_NAMELESS] if "" in offered else []
            if not names:
                return found or [_NONE_OFFERED]
            task = bars.add_task(f"listening to {', '.join(names)}", total=args.seconds)
            began_s = time.monotonic()
            heard = listen(
                names, seconds=args.seconds, image_topic=args.image_topic, stop=stop,
                progress=lambda seconds: bars.update(task, completed=seconds),
            )  # fmt: skip
            if stop.received:
                raise KeyboardInterrupt
    except RosMissingError:
        return []  # `check_machine` reports it.
    except ConfigError as error:
        return [Finding("cameras", RED, "", str(error), "rename the camera, or the topic")]
    streams = {name: CameraStream(*received) for name, received in heard.items()}
    # It waits longer for a first image.
    listened_s = round(time.monotonic() - began_s, 1)
    return found + check_streams(streams, backgrounds, listened_s=listened_s)
