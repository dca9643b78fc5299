"""Measure the published figures: `make bench`; `bench/run.py PART...` for some of them."""

import argparse
import shutil
import sys
import time
from pathlib import Path

from markerless_tracker.cli.main import main

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
# At full size balance_real has four times the pixels and nearly the same error.
RECORDINGS = {"render_walk": "1", "render_reach": "1", "render_kick": "1", "balance_real": "0.5"}
# Of the persons whose stature is known: the parts that need it run for them.
STATURES = {"render_walk": "1.72", "balance_real": "1.70"}
PARTS = ("accuracy", "start", "automatic", "cameras", "recovery", "jitter", "speed")
STAND = "--motion stand --seconds 3 --body person31 --noise 8 --seed 2".split()
# Takes hours, runs only if named.
LONG = ("papers",)


def run(words: list[str]) -> None:
    print(f"\n$ markerless_tracker {' '.join(words)}", flush=True)
    status = main(words)
    if status:
        sys.exit(status)


def bench(parts: list[str], data: Path, out: Path, seeds: int) -> None:
    found = []
    for name in RECORDINGS:
        if (data / name / "ground_truth.trc").is_file():
            found.append(name)
        else:
            print(f"{name}: left out, no such recording in {data}", flush=True)
    for name in found:
        tables = [
            "benchmark", "tables", str(data / name), "--scale", RECORDINGS[name],
            "--fps", "60,20", "--seeds", str(seeds), "-o",
        ]  # fmt: skip
        if "accuracy" in parts:
            run([*tables, str(out / name), "--preset", "tuned,paper", "--truth-score"])
        if "papers" in parts:
            run([*tables, str(out / f"{name}_papers"), "--table", "all", "--truth-score"])
        if "start" in parts:
            for noise in ("10", "20"):
                where = str(out / f"{name}_start_{noise}")
                run([*tables, where, "--preset", "tuned", "--start-noise", noise])
        if name not in STATURES:
            continue
        person = ["--stature", STATURES[name], "--scale", RECORDINGS[name], "--seeds", "5"]
        if "automatic" in parts:
            run(["benchmark", "start", str(data / name), *person])
        if "cameras" in parts:
            run(["benchmark", "cameras", str(data / name), *person[:4]])
        if "recovery" in parts and name == "render_walk":
            run(["benchmark", "recovery", str(data / name), *person])
    if "jitter" in parts:
        stand = out / "stand"
        # Made anew: what makes it may have changed.
        shutil.rmtree(stand, ignore_errors=True)
        run(["synthesize", str(stand), *STAND])
        walks = [str(data / name) for name in found if name == "render_walk"]
        run(["benchmark", "jitter", str(stand), *walks])
    if "speed" in parts:
        run(["benchmark", "speed"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "parts",
        nargs="*",
        metavar="PART",
        help=f"of {', '.join((*PARTS, *LONG))}; default: all but the last",
    )
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the recordings")
    parser.add_argument("-o", dest="out", type=Path, default=ROOT / "out" / "bench")
    parser.add_argument("--seeds", type=int, default=6)
    args = parser.parse_args()
    known = (*PARTS, *LONG)
    unknown = sorted(set(args.parts) - set(known))
    if unknown:
        parser.error(f"unknown part {', '.join(unknown)}, expected some of {', '.join(known)}")
    started = time.monotonic()
    bench(args.parts or list(PARTS), args.data, args.out, args.seeds)
    print(f"\n{time.monotonic() - started:.0f} s; tables and runs are in {args.out}")
