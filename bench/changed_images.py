"""How `track` does on recordings whose images were made worse, with nothing given.

    python bench/changed_images.py RECORDING... [--changes dark,noisy,grey,pale,flicker,blurred]
        [--seed 0]

The videos (.mp4) of each recording folder and of its backgrounds are changed in a copy, which is
tracked and compared with `ground_truth.trc`, without the first 30 frames. Printed: mean error and
largest error of a joint, mm.
"""

import argparse
import json
import shutil
import tempfile
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import cv2
import numpy as np

from markerless_tracker.cli.main import main
from markerless_tracker.imaging.images import FloatImage, Image

TRUTH = "ground_truth.trc"
SKIP = "30"
FLICKER_FRAMES = 7.3
"""Period of the flickering light; the cameras see it a quarter of a period apart."""

Change = Callable[[FloatImage, int, int, np.random.Generator], FloatImage]


def grey_of(image: FloatImage) -> FloatImage:
    """The grey image of a colour image (h, w, 3), in three channels."""
    grey = cv2.cvtColor(image.astype(np.float32), cv2.COLOR_BGR2GRAY)
    return np.repeat(grey[..., None], 3, axis=2)


def flickering(image: FloatImage, frame: int, camera: int, _: np.random.Generator) -> FloatImage:
    """An image with 6 % more or less light."""
    return image * (1.0 + 0.06 * np.sin(2.0 * np.pi * (frame / FLICKER_FRAMES + camera / 4.0)))


CHANGES: dict[str, Change] = {
    "dark": lambda image, _, __, rng: 0.45 * image + rng.normal(0.0, 2.0, image.shape),
    "noisy": lambda image, _, __, rng: image + rng.normal(0.0, 6.0, image.shape),
    "grey": lambda image, *_: grey_of(image),
    "pale": lambda image, *_: grey_of(image) + 0.35 * (image - grey_of(image)),
    "flicker": flickering,
    "blurred": lambda image, *_: cv2.GaussianBlur(image, (0, 0), 1.8),
}


def changed(
    image: Image, change: Change, frame: int, camera: int, rng: np.random.Generator
) -> Image:
    """A changed image (h, w, 3) uint8."""
    found = change(image.astype(np.float32), frame, camera, rng)
    return np.clip(np.rint(found), 0.0, 255.0).astype(np.uint8)


def copy_video(
    source: Path, target: Path, change: Change, camera: int, *, moves: bool, seed: int
) -> None:
    """Copy a video as Motion JPEG with changed images; the light changes only if it `moves`."""
    rng = np.random.default_rng([camera, moves, seed])
    video = cv2.VideoCapture(str(source))
    size_px = [int(video.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    codec = cv2.VideoWriter.fourcc(*"MJPG")
    out = cv2.VideoWriter(str(target), codec, video.get(cv2.CAP_PROP_FPS), size_px)
    out.set(cv2.VIDEOWRITER_PROP_QUALITY, 96)
    frame = 0
    while (read := video.read())[0]:
        out.write(changed(read[1], change, frame if moves else 0, camera, rng))
        frame += 1
    out.release()


def copy_recording(source: Path, target: Path, change: Change, seed: int) -> None:
    """Copy a folder with videos of cameras and of their backgrounds."""
    (target / "background").mkdir(parents=True)
    for name in (TRUTH, "calibration.toml"):
        shutil.copy(source / name, target)
    for folder in (source, source / "background"):
        for camera, path in enumerate(sorted(folder.glob("*.mp4"))):
            where = target / path.relative_to(source).with_suffix(".avi")
            copy_video(path, where, change, camera, moves=folder == source, seed=seed)


def run() -> None:
    """Track all recordings with all changes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--changes", default=",".join(CHANGES), help="names, with commas")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    args = parser.parse_args()
    for recording in args.recordings:
        for name in args.changes.split(","):
            with tempfile.TemporaryDirectory() as made:
                folder, out = Path(made) / recording.name, Path(made) / "out.trc"
                copy_recording(recording, folder, CHANGES[name], args.seed)
                with redirect_stdout(StringIO()):
                    main(["track", str(folder), "-o", str(out)])
                with redirect_stdout(StringIO()) as printed:
                    main(["evaluate", str(out), str(folder / TRUTH), "--skip", SKIP, "--json"])
                found = json.loads(printed.getvalue())
                mean_mm, worst_mm = found["mean_mm"], found["worst_joint_mm"]
                print(f"{recording.name} {name}: {mean_mm:.1f}, {worst_mm:.0f}", flush=True)


if __name__ == "__main__":
    run()
