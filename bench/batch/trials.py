"""Many short made-up trials in one batch: workers killed on the way, and the gain of two workers.

`kills`: 200 trials on two processes, of which one is killed several times; then on two workers of a
Dask cluster, of which one is killed. Every trial must have its result, written once, with the bytes
of an undisturbed batch. `speed`: the same trials on one process and on two, each with one thread;
`ratio_on_free_cores` follows from the CPU times, for trials that divide evenly on two free cores.
"""

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.cli.batch.trial import RECORDS
from markerless_tracker.datasets import MarkerTrack, new_recording
from markerless_tracker.synthesis import MOTIONS, SyntheticScene

ROOT = Path(__file__).resolve().parent.parent.parent
PARTS = ("kills", "speed")
SCENES = 10
QUICK = {
    "body": "balan31", "optimizer": "sppso", "refinement": "contour", "fit_shape": False,
    "edge_weight": 0.5, "seed": 1,
}  # fmt: skip
SIZES = {"kills": ((192, 144), 6, 500), "speed": ((320, 240), 12, 4000)}
"""Part -> size of the images in px, frames of a trial, evaluations."""


def trials(folder: Path, part: str, count: int) -> None:
    """That many recordings: a few made-up scenes, each several times."""
    size_px, frames, _ = SIZES[part]
    for number in range(count):
        path = folder / f"day{number % 7}" / f"trial_{number:03d}"
        if number >= SCENES:
            first = number % SCENES
            shutil.copytree(folder / f"day{first % 7}" / f"trial_{first:03d}", path)
            continue
        motion = sorted(MOTIONS)[number % len(MOTIONS)]
        scene = SyntheticScene(
            body="balan31", motion=motion, size_px=size_px, fps=30.0, seed=number, noise=2.0
        )
        stamps = np.array([scene.stamp_ns(index) for index in range(frames)])
        truth = np.stack([scene.markers(index) for index in range(frames)])
        with new_recording(path, scene.rig, scene.fps) as out:
            for name, images in scene.backgrounds(4).items():
                out.write_background(name, images)
            for index in range(frames):
                out.write(scene.frame(index)[0])
            out.write_truth(MarkerTrack(MARKER_NAMES, stamps, truth))


def batch(work: Path, out: str, part: str, *options: str) -> "subprocess.Popen[str]":
    """A batch that runs."""
    settings = work / "settings.yaml"
    text = yaml.safe_dump({**QUICK, "evaluations": SIZES[part][2]})
    settings.write_text(text, encoding="utf-8")
    words = [str(work / part), "-o", str(work / out), "--config", str(settings), "--json"]
    start = ["--start", "{source}/ground_truth.trc", "--threads", "1"]
    return subprocess.Popen(
        [sys.executable, "-m", "markerless_tracker", "batch", *words, *start, *options],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip


def ended(process: "subprocess.Popen[str]") -> dict[str, Any]:
    """The summary of a batch."""
    text, _ = process.communicate()
    if process.returncode:
        sys.exit(f"batch: status {process.returncode}\n{text[-2000:]}")
    return dict(json.loads(text))


class Watch(threading.Thread):
    """Sees every record when it is complete, and kills a worker now and then.

    Args:
        records: folder of the records.
        workers: the processes of the workers.
        kills: number of kills.
        every: records between two kills.
    """

    def __init__(
        self, records: Path, workers: Callable[[], list[int]], kills: int, every: int
    ) -> None:
        super().__init__(daemon=True)
        self._records, self._workers, self._left, self._every = records, workers, kills, every
        self.seen: dict[str, int] = {}
        self.killed = 0
        self.over = False

    def run(self) -> None:
        """Look and kill until it is over."""
        rng = random.Random(5)
        while not self.over:
            self.look()
            if self._left and len(self.seen) >= self._every * (self.killed + 1):
                # At any moment of a trial.
                time.sleep(rng.uniform(0.0, 0.5))
                workers = self._workers()
                if workers:
                    os.kill(rng.choice(workers), signal.SIGKILL)
                    self.killed += 1
                    self._left -= 1
            time.sleep(0.02)

    def look(self) -> None:
        """Remember the time of every new complete record."""
        for path in self._records.glob("day*/*.json"):
            with contextlib.suppress(OSError, ValueError):
                at = path.stat().st_mtime_ns
                if path.name not in self.seen and "row" in json.loads(path.read_text("utf-8")):
                    self.seen[path.name] = at


def children(process: int) -> list[int]:
    """Processes that another one started to do trials."""
    found = []
    for tasks in Path(f"/proc/{process}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += [int(word) for word in tasks.read_text().split()]
    return [pid for pid in found if "spawn_main" in _words(pid)]


def _words(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text()
    return ""


@contextlib.contextmanager
def cluster() -> Iterator[tuple[str, Callable[[], list[int]]]]:
    """Address of a Dask cluster with two workers that are replaced; their processes."""
    import distributed

    here = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    )
    try:
        with distributed.Client(here, set_as_default=False) as client:
            yield here.scheduler_address, lambda: list(client.run(os.getpid).values())
    finally:
        # On a loaded machine workers need longer to end than it waits for them.
        with contextlib.suppress(TimeoutError):
            here.close()


def results(folder: Path) -> Mapping[str, bytes]:
    """Marker files by their names."""
    return {path.name: path.read_bytes() for path in folder.rglob("*.trc")}


def checked(work: Path, out: str, watch: Watch, count: int, summary: Mapping[str, Any]) -> int:
    """Number of kills; every trial was done once, with the result of the undisturbed batch."""
    watch.over = True
    watch.join()
    watch.look()
    rows = [row["name"] for row in summary["trials"]]
    assert summary["totals"]["done"] == count == len(set(rows)) == len(rows), summary["totals"]
    final = {
        path.name: path.stat().st_mtime_ns for path in (work / out / RECORDS).glob("day*/*.json")
    }
    assert final == watch.seen, "a record was written twice"
    assert results(work / out) == results(work / "undisturbed"), "other results"
    assert not list((work / out / RECORDS).glob(".partial-*"))
    return watch.killed


def kills(work: Path, count: int) -> dict[str, Any]:
    trials(work / "kills", "kills", count)
    started = time.perf_counter()
    summary = ended(batch(work, "undisturbed", "kills", "--jobs", "2"))
    undisturbed_s = time.perf_counter() - started
    assert summary["totals"]["done"] == count, summary["totals"]

    process = batch(work, "killed", "kills", "--jobs", "2")
    watch = Watch(work / "killed" / RECORDS, lambda: children(process.pid), 5, count // 8)
    watch.start()
    local = checked(work, "killed", watch, count, ended(process))
    print(f"{count} trials, {local} processes killed: nothing lost or done twice", flush=True)

    with cluster() as (address, workers):
        watch = Watch(work / "cluster" / RECORDS, workers, 1, count // 4)
        process = batch(work, "cluster", "kills", "--scheduler", address)
        watch.start()
        on_cluster = checked(work, "cluster", watch, count, ended(process))
    return {
        "trials": count,
        "undisturbed_s": round(undisturbed_s, 1),
        "killed_processes": local,
        "killed_workers_of_dask": on_cluster,
        "lost": 0,
        "done_twice": 0,
    }


def speed(work: Path, count: int) -> dict[str, Any]:
    trials(work / "speed", "speed", count)
    ended(batch(work, "first", "speed", "--jobs", "1"))
    seconds: dict[int, list[float]] = {1: [], 2: []}
    cpu: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(2):
        for jobs, taken in seconds.items():
            shutil.rmtree(work / "timed", ignore_errors=True)
            started, before = time.perf_counter(), cpu_seconds()
            ended(batch(work, "timed", "speed", "--jobs", str(jobs)))
            taken.append(time.perf_counter() - started)
            cpu[jobs].append(cpu_seconds() - before)
    return {
        "trials": count,
        "one_process_s": [round(value, 1) for value in seconds[1]],
        "two_processes_s": [round(value, 1) for value in seconds[2]],
        "one_process_cpu_s": [round(value, 1) for value in cpu[1]],
        "two_processes_cpu_s": [round(value, 1) for value in cpu[2]],
        "ratio": round(min(seconds[1]) / min(seconds[2]), 2),
        "ratio_on_free_cores": round(2.0 * min(cpu[1]) / min(cpu[2]), 2),
    }


def cpu_seconds() -> float:
    """CPU time of the processes that have ended, s: it hardly depends on what else is running."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument("--trials", type=int, help="default: 200 for kills, 100 for speed")
    parser.add_argument("-o", dest="out", type=Path, default=ROOT / "out" / "batch")
    args = parser.parse_args()
    figures: dict[str, Any] = {}
    for part in args.parts or PARTS:
        work = args.out / f"trials_{os.getpid()}"
        work.mkdir(parents=True)
        before = machine()
        try:
            if part == "kills":
                found = kills(work, args.trials or 200)
            elif part == "speed":
                found = speed(work, args.trials or 100)
            else:
                parser.error(f"part {part}: expected some of {', '.join(PARTS)}")
        finally:
            shutil.rmtree(work)
        figures[part] = {**found, "load": [before["load"], machine()["load"]]}
        print(json.dumps({part: figures[part]}), flush=True)
    figures["machine"] = machine()
    (args.out / "trials.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
