"""Split graph beside single graph: latency, bandwidth and results.

Made-up cameras, a player and a tracker; in the split graph a segmenter beside each camera, and only
evidence on the way to the tracker. With --loss the tracker lies in a network namespace of its own,
behind a forwarder that drops that share of the frames.

    python bench/live/split.py --cameras 4,8 --rates 60,30
    python bench/live/split.py --cameras 8 --rates 0 --loss 0.05      (rate 0: lockstep)
"""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from markerless_tracker.bags import write_bag
from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.body import write_pose
from markerless_tracker.cli.replay.processes import ros_arguments
from markerless_tracker.datasets import FrameSet, Recording
from markerless_tracker.node.ros.profile import apply_profile
from markerless_tracker.synthesis import SyntheticScene

NODE = "markerless_tracker.node.{}.executable"
READY_S, STUCK_S = 300.0, 60.0
LINK = Path(__file__).with_name("forward.py")


class MadeUp(Recording):
    """A walking person before a ring of cameras."""

    def __init__(self, cameras: int, sets: int, size_px: tuple[int, int]) -> None:
        self.scene = SyntheticScene(
            body="person31", cameras=cameras, size_px=size_px, samples=2, seed=3
        )
        super().__init__(
            Path("made_up"), self.scene.rig, scale=1.0, fps=self.scene.fps, frame_count=sets
        )

    def _read(self, start: int, every: int) -> Iterator[FrameSet]:
        for index in range(start, self.frame_count or 0, every):
            yield FrameSet(index, self.scene.stamp_ns(index), self.scene.frame(index)[0])

    def _nearest(self, stamp_ns: int) -> tuple[int, int]:
        # Recording asks for it; writing a bag reads from the first set on.
        raise NotImplementedError("these sets are read in order alone")


@dataclass
class Place:
    """Words before the commands of processes, and what they inherit."""

    tracker: list[str] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=dict)

    def start(self, node: str, log: Path, words: list[str], prefix: list[str]) -> Any:
        """Start an executable of the package."""
        command = [*prefix, sys.executable, "-m", NODE.format(node), *words]
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log.open("wb"), stderr=subprocess.STDOUT,
            env={**os.environ, **self.environment, "ROS_LOG_DIR": str(log.parent)},
        )  # fmt: skip


class Listener:
    """Hears when a set is sent and when its pose comes, and what the nodes say of themselves."""

    def __init__(self, camera: str) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import PoseArray
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from sensor_msgs.msg import CameraInfo

        from markerless_tracker.node.ros.qos import image_qos, latched_qos, output_qos
        from markerless_tracker.node.ros.stamps import stamp_of

        self.context = rclpy.Context()
        rclpy.init(context=self.context, args=[])
        node = self.node = Node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(node)
        self.sent: dict[int, float] = {}
        self.found: dict[int, float] = {}
        self.values: dict[str, dict[str, str]] = {}

        def take(message: Any) -> None:
            for status in message.status:
                self.values[status.name.partition(":")[0].strip("/")] = {
                    pair.key: pair.value for pair in status.values
                }

        def note(times: dict[int, float], message: Any) -> None:
            times.setdefault(stamp_of(message), time.monotonic())

        node.create_subscription(DiagnosticArray, "state", take, latched_qos())
        node.create_subscription(DiagnosticArray, "/diagnostics", take, output_qos())
        node.create_subscription(
            CameraInfo, f"{camera}/camera_info", lambda m: note(self.sent, m), image_qos(depth=50)
        )
        node.create_subscription(
            PoseArray, "marker_poses", lambda m: note(self.found, m), output_qos()
        )

    def spin(self, seconds: float) -> None:
        """Listen for a time."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.executor.spin_once(timeout_sec=0.05)

    def tracker(self) -> dict[str, str]:
        """What the tracker says of itself."""
        return self.values.get("tracker", {})

    def latencies_ms(self) -> np.ndarray:
        """Time from the sending of a set to its pose, ms."""
        return np.array([1e3 * (t - self.sent[s]) for s, t in self.found.items() if s in self.sent])

    def close(self) -> None:
        """Stop listening."""
        self.executor.shutdown()
        self.context.try_shutdown()


def run_graph(
    bag: Path, recording: MadeUp, rate: float, out: Path, place: Place, *, split: bool
) -> dict[str, Any]:
    """Play the bag once; returns a row of the table."""
    out.mkdir(parents=True)
    names = recording.rig.names
    tracker: dict[str, object] = {
        "calibration_file": bag / "calibration.toml",
        "stature": 1.72,
        "start_file": bag / "start.yaml",
        "result_file": out / "result",
        **({"image_transport": "evidence"} if split else {"background_dir": bag / "background"}),
    }
    pace: dict[str, object] = {"rate": rate / recording.fps} if rate else {"lockstep": True}
    listener = Listener(names[0])
    with ExitStack() as stack:
        running: dict[str, Any] = {}

        def begin(node: str, given: dict[str, object], name: str, prefix: list[str]) -> None:
            words = [*ros_arguments(given), "-r", f"__node:={name}"]
            running[name] = place.start(node, out / f"{name}.log", words, prefix)
            stack.callback(end, running[name])

        begin("tracker", tracker, "tracker", place.tracker)
        for name in names if split else ():
            given: dict[str, object] = {"camera": name, "background_dir": bag / "background"}
            begin("segmenter", given, f"segmenter_{name}", [])
        wait(listener, running, lambda: listener.tracker().get("ready") == "true", READY_S, out)
        player: dict[str, object] = {"bag": bag, "wait_for_subscribers": True, **pace}
        begin("player", player, "player", [])
        seen, changed_s = "", time.monotonic()
        while True:
            listener.spin(0.2)
            dealt = listener.tracker().get("dealt_with_ns", "")
            if dealt != seen:
                seen, changed_s = dealt, time.monotonic()
            quiet_s = time.monotonic() - changed_s
            if running["player"].poll() is not None and quiet_s > 3.0:
                break
            if quiet_s > READY_S:
                raise SystemExit(f"no set was dealt with for {READY_S:g} s, see {out}")
        listener.spin(1.0)
    listener.close()
    return row(listener, recording, rate, split=split)


def wait(
    listener: Listener, running: dict[str, Any], ready: Any, limit_s: float, out: Path
) -> None:
    end_s = time.monotonic() + limit_s
    while not ready():
        listener.spin(0.2)
        dead = [name for name, process in running.items() if process.poll() is not None]
        if dead or time.monotonic() > end_s:
            log = "".join((out / f"{name}.log").read_text() for name in dead or running)
            raise SystemExit(f"{', '.join(dead) or 'tracker'}: not ready\n{log}")


def end(process: Any) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STUCK_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def row(listener: Listener, recording: MadeUp, rate: float, *, split: bool) -> dict[str, Any]:
    values, times = listener.tracker(), listener.latencies_ms()
    segmenters = [v for name, v in listener.values.items() if name.startswith("segmenter")]
    raw, sent = (sum(int(v[key]) for v in segmenters) for key in ("bytes_in", "bytes_out"))
    return {
        "graph": "split" if split else "single",
        "cameras": len(recording.rig),
        "rate": rate,
        "sets": recording.frame_count,
        "tracked": int(values["tracked"]),
        "poses": len(listener.found),
        "latency_ms": {
            "median": float(np.median(times)) if times.size else None,
            "p95": float(np.percentile(times, 95)) if times.size else None,
        },
        "segmenter_ms": max((float(v["latency_median_ms"]) for v in segmenters), default=None),
        "bandwidth_share": sent / raw if raw else None,
        "bytes_a_set": sum(_per_image(v) for v in segmenters) if split else None,
        "tracker_cpu_ms": 1e3 * float(values["cpu_s"]) / max(1, int(values["tracked"])),
        "dropped": sum(int(v["dropped"]) for v in segmenters),
    }


def _per_image(values: Mapping[str, str]) -> float:
    """Bytes of evidence that a segmenter sends for an image."""
    return int(values["bytes_out"]) / max(1, int(values["published"]))


def measure(cameras: int, args: argparse.Namespace, folder: Path, place: Place) -> list[Any]:
    recording = MadeUp(cameras, args.sets, args.size)
    bag = folder / f"bag{cameras}"
    write_bag(recording, bag, backgrounds=recording.scene.backgrounds(6))
    write_pose(bag / "start.yaml", recording.scene.body, recording.scene.pose(0))
    rows = []
    for rate in args.rates:
        results = []
        for split in (False, True):
            out = folder / f"{cameras}_{rate:g}_{split}"
            # Images do not cross the link.
            where = place if split else Place()
            rows.append(run_graph(bag, recording, rate, out, where, split=split))
            results.append((out / "result.trc").read_bytes())
        if not rate:
            # At a rate the two skip different sets.
            rows[-1]["same_result"] = results[0] == results[1]
    return rows


class Link:
    """A network namespace of the tracker's own, behind a forwarder that loses frames."""

    def __init__(self, loss: float) -> None:
        self.far = subprocess.Popen(["unshare", "-n", "sleep", "100000"])
        self.enter = ["nsenter", "-t", str(self.far.pid), "-n"]
        mine = os.readlink("/proc/self/ns/net")
        while os.readlink(f"/proc/{self.far.pid}/ns/net") == mine:
            time.sleep(0.05)
        self.forwarder = subprocess.Popen(
            [sys.executable, str(LINK), str(self.far.pid), str(loss)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.forwarder.stdout is not None
        assert self.forwarder.stdout.readline().strip() == "ready"
        for side, prefix in ((1, []), (2, self.enter)):
            for words in (
                "ip link set lo up",
                f"ip addr add 10.97.0.{side}/24 dev link0",
                "ip link set link0 up",
                "ip route add 224.0.0.0/4 dev link0",
            ):
                subprocess.run([*prefix, *words.split()], check=True)

    def close(self) -> dict[str, int]:
        """End it; returns what passed."""
        self.forwarder.terminate()
        counts = self.forwarder.communicate(timeout=30)[0]
        self.far.kill()
        self.far.wait()
        return {key: int(value) for key, value in re.findall(r"(\w+)=(\d+)", counts)}


def numbers(kind: type) -> Any:
    return lambda text: [kind(word) for word in text.split(",")]


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cameras", type=numbers(int), default=[4, 8])
    parser.add_argument("--rates", type=numbers(float), default=[60.0, 30.0])
    parser.add_argument("--sets", type=int, default=120)
    parser.add_argument("--size", type=lambda t: tuple(map(int, t.split("x"))), default=(656, 490))
    parser.add_argument("--loss", type=float, help="share of frames that the link drops")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def main() -> None:
    args = parse()
    if args.loss is not None and os.environ.get("SPLIT_INSIDE") != "1":
        # Root of a user namespace of its own may make network namespaces.
        os.environ["SPLIT_INSIDE"] = "1"
        os.execvp("unshare", ["unshare", "-rn", sys.executable, *sys.argv])
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))
    apply_profile()
    place, link = Place(), None
    if args.loss is not None:
        link = Link(args.loss)
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET"
        place.tracker = link.enter
    else:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    rows: list[Any] = []
    with tempfile.TemporaryDirectory(prefix="split_") as folder:
        for cameras in args.cameras:
            rows += measure(cameras, args, Path(folder), place)
    table: dict[str, Any] = {"machine": machine(), "runs": rows}
    if link is not None:
        table["link"] = link.close()
    if args.json:
        json.dump(table, sys.stdout, indent=2)
        print()
        return
    print(f"{table['machine']}")
    for found in rows:
        print(json.dumps(found))
    if link is not None:
        print(f"link: {table['link']}")


if __name__ == "__main__":
    main()
