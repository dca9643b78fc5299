"""Verb `synthesize`: renders a synthetic person as a recording with exact reference markers."""

import argparse
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress

from markerless_tracker.body import MARKER_NAMES, Subject, write_pose, write_subject
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.datasets.writer import new_recording
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis import LIGHTS, MILD_LENS, MOTIONS, SyntheticScene

HELP = (
    "Render a synthetic person (shaded cones in a textured room) as a recording folder: "
    "calibration, videos, empty-scene images, exact masks and markers, subject and start pose. "
    "Errors on it test the software; they do not measure the accuracy on real images."
)
EXAMPLE = "markerless_tracker synthesize recordings/synthetic --seconds 2 --motion balance"
EMPTY_IMAGES = 10
_MOST_FRAMES = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write (new or empty)")
    parser.add_argument("--seconds", type=float, default=4.0, help="duration in s (default 4)")
    parser.add_argument("--fps", type=float, default=60.0, help="frames per second (default 60)")
    parser.add_argument(
        "--motion", choices=MOTIONS, default="walk", help="motion of the person (default walk)"
    )
    parser.add_argument("--cameras", type=int, default=4, help="number of cameras (default 4)")
    parser.add_argument(
        "--size",
        metavar="WxH",
        default="656x490",
        help="image size in px (default 656x490)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of motion, room, clothes and noise (default 0)"
    )
    parser.add_argument(
        "--stature",
        metavar="M",
        type=float,
        default=1.72,
        help="body height in m (default 1.72)",
    )
    parser.add_argument(
        "--body", default="balan31", help="body model by name or YAML file (default balan31)"
    )
    parser.add_argument(
        "--noise", metavar="SIGMA", type=float, default=3.0,
        help="standard deviation of the sensor noise in grey levels (default 3)",
    )  # fmt: skip
    parser.add_argument(
        "--shadow", type=float, default=0.35,
        help="fraction of the light that the shadow on the floor removes (default 0.35)",
    )  # fmt: skip
    parser.add_argument(
        "--light", choices=tuple(LIGHTS), default="steady",
        help="drift: 20 %% brighter and darker in 10 s; step: 30 %% brighter from 1 s on",
    )  # fmt: skip
    parser.add_argument("--grey", action="store_true", help="greyscale cameras")
    parser.add_argument(
        "--dull", action="store_true", help="grey clothes within 10 %% of the room's brightness"
    )
    parser.add_argument("--undistorted", action="store_true", help="no lens distortion")
    parser.add_argument("--lossless", action="store_true", help="lossless videos (large)")
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the recording; returns the exit status."""
    frames = _frames(args.seconds, args.fps)
    scene = SyntheticScene(
        body=args.body,
        stature_m=args.stature,
        motion=args.motion,
        cameras=args.cameras,
        size_px=_size(args.size),
        fps=args.fps,
        seed=args.seed,
        noise=args.noise,
        shadow=args.shadow,
        light=args.light,
        grey=args.grey,
        dull=args.dull,
        distortion=(0.0,) * 5 if args.undistorted else MILD_LENS,
    )
    with Progress(console=Console(file=sys.stderr)) as bar:
        task = bar.add_task("frames", total=frames)
        synthesize(
            args.out,
            scene,
            frames=frames,
            lossless=args.lossless,
            progress=lambda done: bar.update(task, completed=done),
        )
    if args.json:
        print(json.dumps({
            "path": str(args.out), "frames": frames, "fps": args.fps, "motion": args.motion,
            "cameras": list(scene.rig.names), "seed": args.seed, "body": scene.body.name,
        }))  # fmt: skip
    else:
        print(f"{args.out}: {frames} frames of {len(scene.rig)} cameras, with exact truth")
    return 0


def synthesize(
    out: str | Path,
    scene: SyntheticScene,
    *,
    frames: int,
    mask_every: int = 50,
    lossless: bool = False,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Write the first frames of a scene as a recording folder, which appears when it is complete.

    Written: `calibration.toml`, `camNN.mp4` (`.mkv` if lossless: some 0.6 MB per image of 656x490),
    `background/camNN/` with empty images, `masks/camNN/FFFFFF.png` for every `mask_every`-th frame,
    `ground_truth.trc` (the 15 markers of every frame), `subject.yaml` and `start.yaml` (the true
    pose of frame 0).

    Args:
        out: a new or an empty folder.
        scene: the scene, with its frame rate.
        frames: number of frames.
        mask_every: exact masks are written for every such frame.
        lossless: write lossless instead of MPEG-4 videos.
        progress: called with the number of frames written so far.

    Raises:
        DatasetError: `out` is not empty or cannot be written, or a size is odd.
    """
    with new_recording(out, scene.rig, scene.fps, lossless=lossless) as writer:
        for name, images in scene.backgrounds(EMPTY_IMAGES).items():
            writer.write_background(name, images)
        write_subject(writer.folder / "subject.yaml", Subject("made up", scene.body.lengths_m))
        write_pose(writer.folder / "start.yaml", scene.body, scene.pose(0))
        for index in range(frames):
            views, masks, _ = scene.frame(index)
            wanted = masks if index % mask_every == 0 else {}
            pictures = {
                name: mask.astype(np.uint8) * np.uint8(255) for name, mask in wanted.items()
            }
            writer.write(views, masks=pictures)
            if progress is not None:
                progress(index + 1)
        stamps = np.array([scene.stamp_ns(i) for i in range(frames)], dtype=np.int64)
        truth = np.array([scene.markers(i) for i in range(frames)])
        writer.write_truth(MarkerTrack(MARKER_NAMES, stamps, truth))


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if match is None:
        raise ConfigError(f"size is {text!r}, expected WxH such as 656x490")
    return int(match[1]), int(match[2])


def _frames(seconds: float, fps: float) -> int:
    count = seconds * fps
    if not 0.5 <= count <= _MOST_FRAMES:
        raise ConfigError(f"{seconds:g} s at {fps:g} fps, expected 1 to {_MOST_FRAMES} frames")
    return round(count)
