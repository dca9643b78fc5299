"""Verb `synthesize`: renders a synthetic person as a recording with exact reference markers."""

import argparse
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from markerless_tracker.body import MARKER_NAMES, write_pose, write_subject
from markerless_tracker.camera.board import (
    BOARD_FILE,
    CHARUCO,
    CHECKERBOARD,
    DICTIONARY,
    MARKER_SHARE,
    Board,
    board_squares,
    write_board,
)
from markerless_tracker.cli.terminal.notices import Bars
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.datasets.writer import new_recording
from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis import (
    LIGHTS,
    MILD_LENS,
    MOST_CAMERAS,
    MOTIONS,
    SyntheticScene,
)
from markerless_tracker.synthesis.boards import BoardScene
from markerless_tracker.synthesis.people import ACTIONS
from markerless_tracker.synthesis.scenes import GeneratedScene

HELP = (
    "Render a synthetic person (shaded cones in a textured room) as a recording folder: "
    "calibration, videos, empty-scene images, exact markers and masks (of every 50th frame), "
    "subject and start pose. "
    "Errors on it test the software; they do not measure the accuracy on real images. --scene "
    "SEED renders a sampled room and a clothed person with other shapes than the tracker's cones; "
    "--checkerboard renders a moving calibration board for `calibrate`, seen by the same cameras."
)
EXAMPLE = "markerless_tracker synthesize made_up --seconds 2 --motion balance"
EMPTY_IMAGES = 10
LEAST_CAMERAS = 2
"""Least number of cameras for tracking and for the calibration of a rig."""
_MOST_FRAMES = 100_000
_NOT_WITH_SCENE = (
    "cameras", "size", "seed", "stature", "body", "noise", "shadow", "light", "grey", "dull",
    "undistorted",
)  # fmt: skip
_ONLY_PEOPLE = ("scene", "motion", "stature", "body", "shadow", "light", "grey", "dull")
_RATES = {"person": (4.0, 60.0), "board": (40.0, 10.0)}
"""Default duration (s) and frame rate (1/s)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write (new or empty)")
    parser.add_argument(
        "--seconds", metavar="S", type=float, help="duration in s (default 4, of a board 40)"
    )
    parser.add_argument(
        "--fps", metavar="N", type=float, help="frames per second (default 60, of a board 10)"
    )
    parser.add_argument(
        "--checkerboard", action="store_true",
        help="render a checkerboard instead of a person: on the floor, where its frame is the "
        "world's, then moved in front of all cameras",
    )  # fmt: skip
    parser.add_argument(
        "--charuco", action="store_true", help="as --checkerboard, with a ChArUco board"
    )
    parser.add_argument(
        "--squares", metavar="CxR", help="columns and rows of the board (default 10x7)"
    )
    parser.add_argument(
        "--square-size", metavar="M", type=float, help="side of a square in m (default 0.12)"
    )
    parser.add_argument(
        "--motion", choices=ACTIONS, metavar="MOTION",
        help=f"motion of the person: {', '.join(MOTIONS)} (default walk); with --scene also "
        f"{', '.join(one for one in ACTIONS if one not in MOTIONS)} (default: the scene's)",
    )  # fmt: skip
    parser.add_argument(
        "--scene", metavar="SEED", type=int,
        help="render the generated scene of this seed: room, lamps, cameras, clothes, person; "
        "with --seconds, --fps, --motion, --lossless and --json only",
    )  # fmt: skip
    parser.add_argument(
        "--cameras", metavar="N", type=int, default=4,
        help=f"number of cameras, {LEAST_CAMERAS} to {MOST_CAMERAS} (default 4)",
    )  # fmt: skip
    parser.add_argument(
        "--size",
        metavar="WxH",
        default="656x490",
        help="image size in px (default 656x490)",
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=int,
        default=0,
        help="seed of motion, room, clothes and noise (default 0)",
    )
    parser.add_argument(
        "--stature",
        metavar="M",
        type=float,
        default=1.72,
        help="body height in m (default 1.72)",
    )
    parser.add_argument(
        "--body",
        metavar="NAME|FILE",
        default="balan31",
        help="body model by name or YAML file (default balan31)",
    )
    parser.add_argument(
        "--noise", metavar="LEVELS", type=float, default=3.0,
        help="standard deviation of the sensor noise in grey levels (default 3)",
    )  # fmt: skip
    parser.add_argument(
        "--shadow", metavar="FRACTION", type=float, default=0.35,
        help="fraction of the light that the shadow on the floor removes, 0 to 1 (default 0.35)",
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
    if args.checkerboard and args.charuco:
        raise ConfigError("--checkerboard and --charuco are two boards, expected one of them")
    if not LEAST_CAMERAS <= args.cameras <= MOST_CAMERAS:
        raise ConfigError(
            f"--cameras is {args.cameras}, expected {LEAST_CAMERAS} to {MOST_CAMERAS}: one camera "
            "does not see how far away a limb is"
        )
    is_board = args.checkerboard or args.charuco
    default_s, default_fps = _RATES["board" if is_board else "person"]
    args.seconds = default_s if args.seconds is None else args.seconds
    args.fps = default_fps if args.fps is None else args.fps
    frames = _frames(args.seconds, args.fps)
    if is_board:
        return _board(args, frames)
    for name in ("squares", "square_size"):
        if getattr(args, name) is not None:
            raise ConfigError(f"--{name.replace('_', '-')} needs --checkerboard or --charuco")
    with Bars(Console(stderr=True)) as bars:
        bars.begin(f"preparing {args.out.name}")
        scene = _synthetic(args) if args.scene is None else _generated(args)
        bars.begin(f"rendering {args.out.name}", frames)
        synthesize(args.out, scene, frames=frames, lossless=args.lossless, progress=bars.step)
    if args.json:
        print(json.dumps({
            "path": str(args.out), "frames": frames, "fps": args.fps, "motion": scene.motion.kind,
            "cameras": list(scene.rig.names), "seed": scene.seed, "body": scene.body.name,
        }))  # fmt: skip
    else:
        print(f"{args.out}: {frames} frames of {len(scene.rig)} cameras, with exact truth")
    return 0


def _board(args: argparse.Namespace, frames: int) -> int:
    """Write the recording of a board."""
    _refuse(args, _ONLY_PEOPLE, "a board has no person")
    columns, rows = board_squares(args.squares or "10x7")
    square_m = 0.12 if args.square_size is None else args.square_size
    board = (
        Board(CHARUCO, columns, rows, square_m, MARKER_SHARE * square_m, DICTIONARY)
        if args.charuco
        else Board(CHECKERBOARD, columns, rows, square_m)
    )
    with Bars(Console(stderr=True)) as bars:
        bars.begin(f"preparing {args.out.name}")
        scene = BoardScene(
            board,
            cameras=args.cameras,
            size_px=_size(args.size),
            fps=args.fps,
            seconds=args.seconds,
            seed=args.seed,
            noise=args.noise,
            distortion=(0.0,) * 5 if args.undistorted else MILD_LENS,
        )
        bars.begin(f"rendering {args.out.name}", frames)
        with new_recording(args.out, scene.rig, scene.fps, lossless=args.lossless) as writer:
            write_board(writer.folder / BOARD_FILE, board)
            for index in range(frames):
                writer.write(scene.frame(index))
                bars.step(index + 1)
    if args.json:
        print(json.dumps({
            "path": str(args.out), "frames": frames, "fps": args.fps, "board": board.kind,
            "squares": [columns, rows], "square_size": square_m,
            "cameras": list(scene.rig.names), "seed": scene.seed,
        }))  # fmt: skip
    else:
        print(f"{args.out}: {frames} frames of {len(scene.rig)} cameras, {board.describe()}")
    return 0


def _synthetic(args: argparse.Namespace) -> SyntheticScene:
    return SyntheticScene(
        body=args.body,
        stature_m=args.stature,
        motion=args.motion or "walk",
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


def _generated(args: argparse.Namespace) -> GeneratedScene:
    _refuse(args, _NOT_WITH_SCENE, "--scene samples everything itself")
    return GeneratedScene(args.scene, fps=args.fps, motion=args.motion)


def _refuse(args: argparse.Namespace, names: Sequence[str], why: str) -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    for name in names:
        if getattr(args, name) != parser.get_default(name):
            raise ConfigError(f"{why}, expected no --{name}")


def synthesize(
    out: str | Path,
    scene: SyntheticScene | GeneratedScene,
    *,
    frames: int,
    mask_every: int = 50,
    lossless: bool = False,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Write the first frames of a scene as a recording folder, which appears when it is complete.

    Written: `calibration.toml`, `camNN.mp4` (`.mkv` if lossless: some 0.6 MB per image of 656x490),
    `background/camNN/` with empty images, `masks/camNN/FFFFFF.png` for every `mask_every`-th frame,
    `ground_truth.trc` (the 15 markers of every frame), `subject.yaml`, `start.yaml` (the true pose
    of frame 0; absent if the tracker's body cannot take this pose), and `scene.json` with the
    sampled values of a generated scene.

    Args:
        out: a new or an empty folder.
        scene: the scene, with its frame rate.
        frames: number of frames.
        mask_every: exact masks are written for every k-th frame.
        lossless: write lossless instead of MPEG-4 videos.
        progress: called with the number of frames written so far.

    Raises:
        DatasetError: `out` is not empty or cannot be written, or a size is odd.
    """
    with new_recording(out, scene.rig, scene.fps, lossless=lossless) as writer:
        for name, images in scene.backgrounds(EMPTY_IMAGES).items():
            writer.write_background(name, images)
        write_subject(writer.folder / "subject.yaml", scene.subject())
        start = scene.start()
        if start is not None:
            write_pose(writer.folder / "start.yaml", *start)
        if isinstance(scene, GeneratedScene):
            values = json.dumps(scene.values(), indent=2)
            (writer.folder / "scene.json").write_text(values + "\n", encoding="utf-8")
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
        raise ConfigError(f"--size is {text!r}, expected WxH such as 656x490")
    return int(match[1]), int(match[2])


def _frames(seconds: float, fps: float) -> int:
    count = seconds * fps
    if not 0.5 <= count <= _MOST_FRAMES:
        raise ConfigError(f"{seconds:g} s at {fps:g} fps, expected 1 to {_MOST_FRAMES} frames")
    return round(count)
