"""MediaPipe Pose per view with triangulation beside this tracker, on recordings: `make peer`.

Both results are marker files of the 12 limb joints or more; the verb `evaluate` scores both.
MediaPipe runs in an environment of its own (`.venv-peer`), since it needs older libraries.
"""

import argparse
import contextlib
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from triangulation import joint_track

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.cli.main import main as verb
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.markers.trc import write_trc
from markerless_tracker.datasets.truth import TRUTH

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PEER = ROOT / ".venv-peer" / "bin" / "python"
DATA = ROOT.parent / "shared" / "data"
RECORDINGS = ("render_walk", "render_reach", "render_kick", "balance_real")


def call(words: list[str]) -> dict[str, Any]:
    """The JSON that a verb prints."""
    print(f"$ markerless_tracker {' '.join(words)}", file=sys.stderr, flush=True)
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        status = verb([*words, "--json"])
    if status:
        sys.exit(status)
    return json.loads(text.getvalue())


def peer(source: Path, out: Path, python: Path) -> dict[str, Any]:
    """Landmarks, triangulation, TRC; returns the version and the sets per second."""
    recording = open_recording(source)
    words = [str(HERE / "landmarks.py"), str(source), ",".join(recording.rig.names)]
    file = out / f"{source.name}.npz"
    done = subprocess.run([str(python), *words, str(file)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr.splitlines()[-1] if done.stderr else f"{python} failed")
    track = joint_track(np.load(file)["landmarks"], recording)
    write_trc(out / f"{source.name}_peer.trc", track, recording.fps)
    return dict(json.loads(done.stdout))


def compare(source: Path, out: Path, python: Path, options: list[str]) -> list[dict[str, Any]]:
    """Rows of the table for one recording."""
    truth = source / TRUTH
    about = peer(source, out, python)
    rows = [
        {
            "recording": source.name,
            "tracker": f"MediaPipe {about['version']} full",
            "sets_per_s": about["sets"] / about["seconds"],
            **scored(out / f"{source.name}_peer.trc", truth),
        }
    ]
    scale = ["--scale", "0.5"] if source.name == "balance_real" else []
    runs = {
        "automatic start": [],
        "automatic start, two passes": ["--passes", "2"],
        "measured start": ["--start", str(truth)],
    }
    for number, (name, start) in enumerate(runs.items()):
        result = out / f"{source.name}_{number}"
        done = call(["track", str(source), "-o", str(result), "--force", *scale, *start, *options])
        rows.append(
            {
                "recording": source.name,
                "tracker": f"this, {name}",
                "sets_per_s": done["frames_per_s"],
                **scored(Path(f"{result}.trc"), truth),
            }
        )
    return rows


def scored(result: Path, truth: Path) -> dict[str, Any]:
    """Errors of the limb joints that both trackers have."""
    found = call(["evaluate", str(result), str(truth)])
    return {
        "limbs_mm": found["limbs_mm"],
        "limbs_offsets_off_mm": found["offsets_off_mm"]["limbs"],
        "frames": found["frames"],
        "reference_frames": found["reference_frames"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", metavar="NAME", help="default: all in --data")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the recordings")
    parser.add_argument("--python", type=Path, default=PEER, help="Python that has MediaPipe")
    parser.add_argument("-o", dest="out", type=Path, default=ROOT / "out" / "peer")
    parser.add_argument(
        "--options", default="", help="options of `track` for every recording, in one word"
    )
    args = parser.parse_args()
    if not args.python.is_file():
        sys.exit(f"{args.python}: no such Python; `make peer` makes it from requirements/peer.txt")
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in args.recordings or RECORDINGS:
        if not (args.data / name / TRUTH).is_file():
            print(f"{name}: left out, no such recording with {TRUTH} in {args.data}")
            continue
        rows += compare(args.data / name, args.out, args.python, args.options.split())
    if not rows:
        sys.exit(1)
    table = Table("recording", "tracker")
    for heading in ("limb joints, mm", "offsets off, mm", "frames", "sets/s"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            row["recording"], row["tracker"], f"{row['limbs_mm']:.1f}",
            f"{row['limbs_offsets_off_mm']:.1f}",
            f"{row['frames']} of {row['reference_frames']}", f"{row['sets_per_s']:.1f}",
        )  # fmt: skip
    Console(width=120).print(table)
    (args.out / "table.json").write_text(
        json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
