"""Every export of every recording, read back by programs of others: how far it is from the result.

    python bench/results/readback.py [-o DIR] [--data DIR] [RECORDING...]

Each recording is tracked from the first row of its truth and exported in all formats. `gap`
is the beginning of a recording with nobody in 20 frames: its files have blank rows.
Asked: positions within 0.1 mm, angles within 0.01 degrees, OpenSim's inverse kinematics on the
model and the markers within 15 mm rms.
"""

import argparse
import json
import shutil
import sys
from dataclasses import asdict
from pathlib import Path

from readers import FORMATS, Difference, read_back
from rich.console import Console
from rich.table import Table

from markerless_tracker.cli.main import main as verb
from markerless_tracker.datasets import new_recording, open_recording
from markerless_tracker.datasets.empty_scene import backgrounds_of

DATA = Path(__file__).resolve().parent.parent.parent.parent / "shared" / "data"
RECORDINGS = ("render_walk", "render_reach", "render_kick", "balance_real")
HALF = ("balance_real",)
FRAMES, GAP = 90, range(40, 60)
MOST_MM, MOST_DEGREES, MOST_RMS_MM = 0.1, 0.01, 15.0


def run(words: list[str]) -> None:
    print(f"$ markerless_tracker {' '.join(words)}", file=sys.stderr, flush=True)
    status = verb(words)
    if status:
        sys.exit(status)


def with_a_gap(source: Path, folder: Path, scale: float) -> Path:
    """A recording's first frames, with the empty scene in those of `GAP`."""
    recording = open_recording(source, scale=scale)
    empty = backgrounds_of(recording)
    shutil.rmtree(folder, ignore_errors=True)
    with new_recording(folder, recording.rig, recording.fps, lossless=True) as writer:
        for name, images in empty.items():
            writer.write_background(name, images)
        for number, frame in enumerate(recording.frames()):
            if number == FRAMES:
                break
            shown = {name: images[number % len(images)] for name, images in empty.items()}
            writer.write(shown if number in GAP else frame.images)
    return folder


def measured(source: Path, name: Path, truth: str, more: list[str]) -> dict[str, Difference]:
    """Track, export and read back."""
    words = ["track", str(source), "-o", str(name), "--start", truth, "--subject-from", truth]
    run([*words, "--body", "person32", "--threads", "1", "--force", *more])
    run(["export", str(name), "--to", FORMATS, "--force"])
    return read_back(name)


def main() -> None:
    """Print the table and write it; exit status 1 where something is farther off than asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="*", default=RECORDINGS)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("-o", dest="out", type=Path, default=Path("out/readback"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[str, Difference]] = {}
    for recording in args.recordings:
        source = args.data / recording
        if not (source / "ground_truth.trc").is_file():
            print(f"{recording}: left out, no such recording in {args.data}", file=sys.stderr)
            continue
        truth, out = str(source / "ground_truth.trc"), args.out / recording
        scale = 0.5 if recording in HALF else 1.0
        more = ["--scale", str(scale)]
        found[recording] = measured(source, out, truth, more)
        smooth = out.with_name(f"{recording}_smooth")
        found[f"{recording}, smoothed"] = measured(source, smooth, truth, [*more, "--smooth"])
        gap = out.with_name(f"{recording}_gap")
        folder = with_a_gap(source, gap.with_name(f"{gap.name}_source"), scale)
        found[f"{recording}, gap"] = measured(folder, gap, truth, [])
    table = Table("result", "read", "mm", "degrees", "s", "notes")
    missed = 0
    for result, differences in found.items():
        for kind, off in differences.items():
            bad = off.mm > (MOST_RMS_MM if kind == "ik" else MOST_MM) or off.degrees > MOST_DEGREES
            missed += bad
            notes = ", ".join(f"{key} {value:.3g}" for key, value in off.notes.items())
            figures = [f"{value:.2g}" for value in (off.mm, off.degrees, off.s)]
            table.add_row(result, kind, *figures, notes, style="red" if bad else "")
    Console(width=120).print(table)
    plain = {name: {k: asdict(v) for k, v in kinds.items()} for name, kinds in found.items()}
    (args.out / "readback.json").write_text(json.dumps(plain, indent=1, default=float) + "\n")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
