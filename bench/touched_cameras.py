"""How well `track --refine-calibration` restores cameras that were touched on purpose.

    python bench/touched_cameras.py RECORDING... [--cameras 1] [--seed 0] [--fps 15]

Each recording folder is tracked with a calibration in which some cameras are rotated about a
random axis, moved in a random direction and zoomed. Printed per camera that was touched or
corrected, before and after: errors of rotation, position, focal length, and of the image of the
person (root mean square over the markers of `ground_truth.trc`).
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from markerless_tracker.calibration.contours.cameras import change_between, moved
from markerless_tracker.camera import (
    CameraModel,
    CameraRig,
    project_camera,
    read_calibration,
    write_calibration,
)
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import read_trc
from markerless_tracker.geometry import FloatArray

CALIBRATION = "calibration.toml"


def touch(
    rig: CameraRig, count: int, rng: np.random.Generator, args: argparse.Namespace
) -> CameraRig:
    """The rig with that many cameras changed."""
    names = set(rng.permutation(rig.names)[:count])

    def change() -> FloatArray:
        turn, shift = rng.normal(size=(2, 3))
        turn *= np.deg2rad(args.degrees) / np.linalg.norm(turn)
        shift *= args.metres / np.linalg.norm(shift)
        return np.array([*turn, *shift, rng.choice([-1.0, 1.0]) * args.focal])

    return CameraRig(tuple(moved(c, change()) if c.name in names else c for c in rig))


def errors(camera: CameraModel, true: CameraModel, points_m: FloatArray) -> str:
    """Errors of a camera, in words."""
    change = change_between(true, camera)
    off = project_camera(points_m, camera) - project_camera(points_m, true)
    return (
        f"{np.degrees(np.linalg.norm(change[:3])):.2f} deg "
        f"{1000.0 * np.linalg.norm(change[3:6]):.0f} mm {100.0 * change[6]:+.2f} % "
        f"{np.sqrt(np.nanmean((off**2).sum(axis=1))):.2f} px"
    )


def restore(recording: Path, wrong: CameraRig, args: argparse.Namespace) -> CameraRig | None:
    """The refined calibration; None if it was refused."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "recording"
        folder.mkdir()
        for path in recording.iterdir():
            if path.name != CALIBRATION:
                (folder / path.name).symlink_to(path.resolve())
        write_calibration(folder / CALIBRATION, wrong)
        refined = Path(made) / "refined.toml"
        words = ["track", folder, "-o", Path(made) / "out", "--refine-calibration", refined]
        if args.fps is not None:
            words += ["--fps", args.fps]
        return read_calibration(refined) if main([str(word) for word in words]) == 0 else None


def run() -> None:
    """Track all recordings."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--cameras", type=int, default=1, help="number of cameras touched")
    parser.add_argument("--degrees", type=float, default=1.0)
    parser.add_argument("--metres", type=float, default=0.03)
    parser.add_argument("--focal", type=float, default=0.01, help="fraction of the focal length")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fps", type=float, help="as of `track`")
    args = parser.parse_args()
    for number, recording in enumerate(args.recordings):
        true = read_calibration(recording / CALIBRATION)
        points = read_trc(recording / "ground_truth.trc").positions_m.reshape(-1, 3)
        wrong = touch(true, args.cameras, np.random.default_rng([args.seed, number]), args)
        better = restore(recording, wrong, args)
        for camera in true:
            before = errors(wrong[camera.name], camera, points)
            after = "refused" if better is None else errors(better[camera.name], camera, points)
            if wrong[camera.name] is not camera or after != errors(camera, camera, points):
                print(f"{recording.name} {camera.name}: {before} -> {after}", flush=True)


if __name__ == "__main__":
    run()
