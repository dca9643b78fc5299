"""Long run of a tracker: memory, threads, files and latency must stay flat.

A made-up person moves to and fro before four cameras; images are published at a fixed rate, or in
lockstep. Every few seconds the tracker and the processes that it started are looked at. Exit status
3 if something grew.

    python bench/live/soak.py --minutes 60 --rate 30
    python bench/live/soak.py --minutes 2 --lockstep --json
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.body import subject_from_stature, write_pose, write_subject
from markerless_tracker.body.load import load_description
from markerless_tracker.camera import write_calibration
from markerless_tracker.cli.replay.processes import ros_arguments
from markerless_tracker.node.ros.cdr import image_bytes, with_stamp
from markerless_tracker.node.ros.profile import apply_profile
from markerless_tracker.synthesis import SyntheticScene

STATURE_M, BODY = 1.72, "person31"
WARM_SHARE = 0.25
"""Share of the run before growth is measured from."""
MEMORY, LATENCY = 0.01, 0.05
"""Largest growth of memory and of latency."""
READY_S, STUCK_S = 600.0, 120.0


@dataclass(frozen=True)
class Sample:
    """The tracker and what it started, at one time."""

    time_s: float
    rss_mib: float
    threads: int
    files: int
    shared: int
    latency_ms: float


class Watch:
    """A node that publishes sets of images and hears the tracker's state."""

    def __init__(self, scene: SyntheticScene, frames: int) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from sensor_msgs.msg import Image

        from markerless_tracker.node.ros.qos import image_qos, latched_qos

        self.context = rclpy.Context()
        rclpy.init(context=self.context, args=[])
        node = Node("cameras", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(node)
        self.publishers = {
            name: node.create_publisher(Image, f"{name}/image_raw", image_qos())
            for name in scene.rig.names
        }
        self.values: dict[str, str] = {}
        node.create_subscription(DiagnosticArray, "state", self._take, latched_qos())
        self.sets = [
            {name: image_bytes(image, 0, name) for name, image in scene.frame(i)[0].items()}
            for i in range(frames)
        ]
        self.sent = 0

    def _take(self, message: Any) -> None:
        self.values = {pair.key: pair.value for pair in message.status[0].values}

    def send(self, stamp_ns: int) -> None:
        """Publish the next set; the motion runs to and fro."""
        last = len(self.sets) - 1
        at = self.sent % (2 * last)
        for name, raw in self.sets[min(at, 2 * last - at)].items():
            self.publishers[name].publish(with_stamp(raw, stamp_ns))
        self.sent += 1

    def until(self, ready: Any, limit_s: float, tracker: Any) -> None:
        """Spin until something holds."""
        end_s = time.monotonic() + limit_s
        while not ready():
            self.executor.spin_once(timeout_sec=0.1)
            if tracker.poll() is not None or time.monotonic() > end_s:
                raise SystemExit(f"the tracker does not go on: {self.values}")


def prepare(folder: Path, size_px: tuple[int, int], rate: float) -> SyntheticScene:
    """Files of the person and the cameras."""
    scene = SyntheticScene(
        body=BODY, stature_m=STATURE_M, size_px=size_px, fps=rate, samples=2, seed=4
    )
    write_calibration(folder / "calibration.toml", scene.rig)
    for name, images in scene.backgrounds(4).items():
        (folder / "background" / name).mkdir(parents=True)
        for number, image in enumerate(images):
            cv2.imwrite(str(folder / "background" / name / f"{number:06d}.png"), image)
    write_subject(folder / "subject.yaml", subject_from_stature(load_description(BODY), STATURE_M))
    write_pose(folder / "start.yaml", scene.body, scene.pose(0))
    return scene


def family(pid: int) -> list[int]:
    """A process, its children and theirs."""
    found = [pid]
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += family(int(child))
    return found


def look(pid: int, began_s: float, latency_ms: float) -> Sample:
    """The processes as they are now."""
    rss = threads = files = shared = 0
    for one in family(pid):
        status = dict(
            line.split(":", 1) for line in Path(f"/proc/{one}/status").read_text().splitlines()
        )
        rss += int(status["VmRSS"].split()[0])
        threads += int(status["Threads"])
        files += len(os.listdir(f"/proc/{one}/fd"))
        maps = Path(f"/proc/{one}/maps").read_text().splitlines()
        shared += len({line.split()[5] for line in maps if "/dev/shm/" in line})
    return Sample(time.monotonic() - began_s, rss / 1024, threads, files, shared, latency_ms)


def soak(args: argparse.Namespace, folder: Path) -> tuple[list[Sample], dict[str, str]]:
    """Run; returns the samples and the tracker's last state."""
    scene = prepare(folder, args.size, args.rate)
    watch = Watch(scene, args.frames)
    given: dict[str, object] = {
        "calibration_file": folder / "calibration.toml",
        "background_dir": folder / "background",
        "subject_file": folder / "subject.yaml",
        "start_file": folder / "start.yaml",
        "result_file": folder / "result",
    }
    module = "markerless_tracker.node.tracker.executable"
    with (folder / "tracker.log").open("wb") as log:
        tracker = subprocess.Popen(
            [sys.executable, "-m", module, *ros_arguments(given)],
            stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
            env={**os.environ, "ROS_LOG_DIR": str(folder)},
        )  # fmt: skip
    samples: list[Sample] = []
    period_ns = round(1e9 / args.rate)
    try:
        watch.until(lambda: watch.values.get("ready") == "true", READY_S, tracker)
        subscribed = [p.get_subscription_count for p in watch.publishers.values()]
        watch.until(lambda: all(count() for count in subscribed), STUCK_S, tracker)
        began_s = looked_s = time.monotonic()
        end_s = began_s + 60.0 * args.minutes
        while time.monotonic() < end_s:
            stamp_ns = (1 + watch.sent) * period_ns
            watch.send(stamp_ns)
            if args.lockstep:
                dealt = str(stamp_ns)
                watch.until(
                    lambda dealt=dealt: watch.values.get("dealt_with_ns") == dealt, STUCK_S, tracker
                )
            else:
                due_s = began_s + watch.sent * period_ns / 1e9
                while (left_s := due_s - time.monotonic()) > 0.0:
                    watch.executor.spin_once(timeout_sec=left_s)
            if time.monotonic() - looked_s >= args.every:
                looked_s = time.monotonic()
                latency_ms = float(watch.values.get("latency_median_ms", "nan"))
                samples.append(look(tracker.pid, began_s, latency_ms))
            if tracker.poll() is not None:
                raise SystemExit((folder / "tracker.log").read_text()[-2000:])
        return samples, watch.values
    finally:
        tracker.send_signal(signal.SIGINT)
        try:
            tracker.wait(STUCK_S)
        except subprocess.TimeoutExpired:
            tracker.kill()
            tracker.wait()
        watch.executor.shutdown()
        watch.context.try_shutdown()


def judge(samples: list[Sample]) -> dict[str, float]:
    """Growth from the first part after warming up to the last one of that length."""
    warm = [s for s in samples if s.time_s >= WARM_SHARE * samples[-1].time_s]
    part = max(1, len(warm) // 3)
    first, last = warm[:part], warm[-part:]

    def middle(which: list[Sample], name: str) -> float:
        return float(np.median([getattr(sample, name) for sample in which]))

    return {
        "memory": middle(last, "rss_mib") / middle(first, "rss_mib") - 1.0,
        "threads": middle(last, "threads") - middle(first, "threads"),
        "files": middle(last, "files") - middle(first, "files"),
        "shared": middle(last, "shared") - middle(first, "shared"),
        "latency": middle(last, "latency_ms") / middle(first, "latency_ms") - 1.0,
    }


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=30.0, help="sets/s, and that of the stamps")
    parser.add_argument("--lockstep", action="store_true", help="the next set after the last")
    parser.add_argument("--every", type=float, default=5.0, help="s between two looks")
    parser.add_argument("--frames", type=int, default=60, help="different sets of images")
    parser.add_argument("--size", type=lambda t: tuple(map(int, t.split("x"))), default=(328, 245))
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def main() -> int:
    args = parse()
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    apply_profile()
    with tempfile.TemporaryDirectory(prefix="soak_") as folder:
        samples, values = soak(args, Path(folder))
        written = sum(p.stat().st_size for p in Path(folder).glob("result*"))
    growth = judge(samples)
    counted = {key: values[key] for key in ("tracked", "skipped", "incomplete", "state")}
    red = [name for name in ("threads", "files", "shared") if growth[name] > 0.0]
    red += ["memory"] if growth["memory"] > MEMORY else []
    # In lockstep the latency is that of a machine that does nothing else.
    red += ["latency"] if growth["latency"] > LATENCY and not args.lockstep else []
    report = {
        "machine": machine(), "minutes": args.minutes, "rate": args.rate,
        "lockstep": args.lockstep, "counts": counted, "result_bytes": written,
        "first": asdict(samples[0]), "last": asdict(samples[-1]), "growth": growth, "red": red,
    }  # fmt: skip
    if args.json:
        print(json.dumps(report, indent=2))
    else:
        for name, value in report.items():
            print(f"{name}: {value}")
    return 3 if red else 0


if __name__ == "__main__":
    sys.exit(main())
