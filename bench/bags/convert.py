"""Throughput and peak memory of `convert`: four colour videos of 644x488 to a bag.

Each conversion is a process of its own; its bag is then forced to the disk. A plain sequential
write of as many bytes, forced to the disk as well, goes before and after it. `writing` writes
images that are in memory: the part without decoding.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table

from markerless_tracker.bags import write_bag
from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.datasets import FrameSet, Recording, new_recording, open_recording, stamp_of
from markerless_tracker.synthesis import SyntheticScene

ROOT = Path(__file__).resolve().parent.parent.parent
SIZE_PX = (644, 488)
RENDERED = 60
BLOCK = bytes(1 << 20)
FPS = 60.0
_VERB = """
import sys, time
from markerless_tracker.cli.main import main
status = main(sys.argv[1:])
print(time.process_time(), file=sys.stderr)
print([line for line in open("/proc/self/status") if "VmHWM" in line][0].strip(), file=sys.stderr)
sys.exit(status)
"""
"""A verb; the last lines on standard error are its CPU time and the most memory it had."""


class InMemory(Recording):
    """Images in memory, repeated."""

    def __init__(self, source: Recording, sets: int) -> None:
        super().__init__(source.path, source.rig, scale=1.0, fps=source.fps, frame_count=sets)
        self._images = [frame.images for frame, _ in zip(source.frames(), range(30), strict=False)]

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        for index in range(start, self.frame_count or 0, every):
            images = self._images[index % len(self._images)]
            yield FrameSet(index, stamp_of(index, self.fps), images)

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        # Recording asks for it; writing a bag reads from the first set on.
        raise NotImplementedError("these sets are read in order alone")


def source(folder: Path, sets: int) -> Path:
    """A recording of that many sets: a person who walks to and fro."""
    path = folder / f"videos_{sets}"
    if not path.is_dir():
        scene = SyntheticScene(size_px=SIZE_PX, fps=FPS, seed=3, noise=2.0, motion="walk")
        frames = [scene.frame(index)[0] for index in range(min(sets, RENDERED))]
        there_and_back = [*frames, *frames[::-1]]
        with new_recording(path, scene.rig, FPS) as out:
            for name, images in scene.backgrounds(3).items():
                out.write_background(name, images)
            for index in range(sets):
                out.write(there_and_back[index % len(there_and_back)])
    return path


def plain(path: Path, size: int) -> float:
    """Seconds of a sequential write of that many bytes."""
    started = time.perf_counter()
    with path.open("wb", buffering=0) as file:
        for _ in range(size // len(BLOCK)):
            file.write(BLOCK)
        file.write(BLOCK[: size % len(BLOCK)])
        os.fsync(file.fileno())
    seconds = time.perf_counter() - started
    path.unlink()
    return seconds


def force(folder: Path) -> float:
    """Seconds until all files of a folder are on the disk."""
    started = time.perf_counter()
    for path in folder.rglob("*.mcap"):
        with path.open("rb") as file:
            os.fsync(file.fileno())
    return time.perf_counter() - started


def converted(videos: Path, bag: Path, options: list[str]) -> dict[str, Any]:
    """One conversion: `frames`, `bytes`, `seconds` and `peak_mb` of its process."""
    words = ["convert", str(videos), str(bag), "--json", *options]
    done = subprocess.run([sys.executable, "-c", _VERB, *words], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    summary = json.loads(done.stdout)
    # The figure of `wait4` would count this process's memory at the start of the other, too.
    cpu_s, peak_kb = float(done.stderr.splitlines()[-2]), int(done.stderr.split()[-2])
    return {
        "frames": summary["frames"],
        "bytes": summary["bytes"],
        "seconds": summary["seconds"] + force(bag),
        "cpu_s": cpu_s,
        "peak_mb": peak_kb * 1024 / 1e6,
    }


def written(videos: Path, bag: Path, sets: int) -> float:
    """Seconds that writing takes for images in memory."""
    recording = InMemory(open_recording(videos), sets)
    started = time.perf_counter()
    write_bag(recording, bag)
    seconds = time.perf_counter() - started + force(bag)
    shutil.rmtree(bag)
    return seconds


def measured(
    videos: Path, work: Path, sets: int, repeats: int, options: list[str]
) -> dict[str, Any]:
    """Figures of one place and length: medians of the repeats."""
    runs, ratios, alone = [], [], []
    for _ in range(repeats):
        bag = work / "bag"
        run = converted(videos, bag, options)
        shutil.rmtree(bag)
        beside = plain(work / "plain", run["bytes"])
        alone.append(beside / written(videos, bag, sets))
        runs.append(run)
        ratios.append(0.5 * (beside + plain(work / "plain", run["bytes"])) / run["seconds"])
    return {
        "place": str(work.parent),
        "sets": sets,
        "options": " ".join(options),
        "mb": runs[0]["bytes"] / 1e6,
        "sets_per_s": median(run["frames"] / run["seconds"] for run in runs),
        "cpu_ms_per_set": median(1000.0 * run["cpu_s"] / run["frames"] for run in runs),
        "of_plain_write": median(ratios),
        "writing_of_plain_write": median(alone),
        "peak_mb": max(run["peak_mb"] for run in runs),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", default="400,1600", help="lengths (default: 400,1600)")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument(
        "--places", default=f"{ROOT / 'out'},/dev/shm", help="folders on the disks to measure"
    )
    parser.add_argument("--options", default="", help="options of convert, in one word")
    args = parser.parse_args()
    kept = ROOT / "out" / "bags"
    kept.mkdir(parents=True, exist_ok=True)
    before, rows = machine(), []
    for place in args.places.split(","):
        work = Path(place) / f"convert_bench_{os.getpid()}"
        work.mkdir(parents=True)
        try:
            for sets in map(int, args.sets.split(",")):
                videos = source(kept, sets)
                rows.append(measured(videos, work, sets, args.repeats, args.options.split()))
        finally:
            shutil.rmtree(work)
    table = Table("place", "options")
    headings = (
        "sets", "MB", "sets/s", "CPU ms/set", "convert / plain write", "writing / plain write",
        "peak MB",
    )  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            row["place"], row["options"], str(row["sets"]), f"{row['mb']:.0f}",
            f"{row['sets_per_s']:.0f}", f"{row['cpu_ms_per_set']:.1f}",
            f"{row['of_plain_write']:.2f}",
            f"{row['writing_of_plain_write']:.2f}", f"{row['peak_mb']:.0f}",
        )  # fmt: skip
    Console(width=140).print(table)
    after = machine()
    print(f"{after['cpu']}, {after['cores']} cores, load {before['load']} to {after['load']}")
    (kept / "convert.json").write_text(
        json.dumps({"before": before, "after": after, "rows": rows}, indent=1) + "\n", "utf-8"
    )


if __name__ == "__main__":
    main()
