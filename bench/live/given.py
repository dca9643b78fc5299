"""A tracker that is given images, or evidence that was made before: what it costs the tracker.

On two machines the segmenters' work is elsewhere. Here messages are made first and then published
at a rate, so that the tracker has the machine for itself and one cheap publisher.

    python bench/live/given.py --cameras 4,8 --rates 60,30
"""

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from split import Listener, MadeUp, Place, end, numbers, row, wait

from markerless_tracker.bags import write_bag
from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.body import write_pose
from markerless_tracker.cli.replay.processes import ros_arguments
from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.node.inputs.wire import FORMAT, settings_digest, silhouette_data
from markerless_tracker.node.ros.camera_info import info_of
from markerless_tracker.node.ros.cdr import image_bytes, with_stamp
from markerless_tracker.node.ros.messages import header
from markerless_tracker.node.ros.profile import apply_profile
from markerless_tracker.node.ros.qos import image_qos
from markerless_tracker.tracking import TrackerConfig


def messages(recording: MadeUp, backgrounds: Any) -> tuple[list[Any], list[Any], float]:
    """Serialised images and evidence of every set, and the evidence's share of the bytes."""
    config = TrackerConfig.from_mapping({})
    digest = settings_digest(config)
    segmenters = {
        name: Segmenter(name, learn_background(frames, config, camera=name), config, edges=False)
        for name, frames in backgrounds.items()
    }
    images, evidence, raw, packed = [], [], 0, 0
    for found in recording.frames():
        images.append({n: image_bytes(view, 0, n) for n, view in found.images.items()})
        sent = {}
        for name, view in found.images.items():
            seen = replace(
                segmenters[name].observe(view, found.stamp_ns), exposure=segmenters[name].gain
            )
            data = silhouette_data(seen, digest)
            raw, packed = raw + view.size, packed + len(data)
            message = CompressedImage(header=header(0), format=FORMAT)
            message.data.frombytes(data)
            sent[name] = bytes(serialize_message(message))
        evidence.append(sent)
    return images, evidence, packed / raw


def run_given(
    bag: Path,
    recording: MadeUp,
    rate: float,
    sets: list[Any],
    out: Path,
    count: int,
    *,
    split: bool,
) -> dict[str, Any]:
    """Publish that many sets, to and fro; returns a row of the table."""
    out.mkdir(parents=True)
    names = recording.rig.names
    listener = Listener(names[0])
    kind, topic = (CompressedImage, "silhouette") if split else (Image, "image_raw")
    node = listener.node
    publishers = {n: node.create_publisher(kind, f"{n}/{topic}", image_qos()) for n in names}
    infos = {n: node.create_publisher(CameraInfo, f"{n}/camera_info", image_qos()) for n in names}
    given: dict[str, object] = {
        "calibration_file": bag / "calibration.toml",
        "stature": 1.72,
        "start_file": bag / "start.yaml",
        **({"image_transport": "evidence"} if split else {"background_dir": bag / "background"}),
    }
    with ExitStack() as stack:
        tracker = Place().start("tracker", out / "tracker.log", ros_arguments(given), [])
        stack.callback(end, tracker)
        running = {"tracker": tracker}
        wait(listener, running, lambda: listener.tracker().get("ready") == "true", 300.0, out)
        counts = [p.get_subscription_count for p in publishers.values()]
        wait(listener, running, lambda: all(count() for count in counts), 60.0, out)
        for camera in recording.rig:
            infos[camera.name].publish(info_of(camera, 0))
        began_s = time.monotonic()
        last = len(sets) - 1
        for number in range(count):
            at = number % (2 * last)
            found = sets[min(at, 2 * last - at)]
            while (left_s := began_s + number / rate - time.monotonic()) > 0.0:
                listener.executor.spin_once(timeout_sec=left_s)
            stamp_ns = recording.scene.stamp_ns(number)
            listener.sent[stamp_ns] = time.monotonic()
            for name, raw in found.items():
                publishers[name].publish(with_stamp(raw, stamp_ns))
        listener.spin(2.0)
    listener.close()
    return {
        **row(listener, recording, rate, split=split),
        "graph": "evidence" if split else "images",
        "sets": count,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cameras", type=numbers(int), default=[4, 8])
    parser.add_argument("--rates", type=numbers(float), default=[60.0, 30.0])
    parser.add_argument("--sets", type=int, default=60, help="different sets of images")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--size", type=lambda t: tuple(map(int, t.split("x"))), default=(656, 490))
    args = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    apply_profile()
    print(machine())
    with tempfile.TemporaryDirectory(prefix="given_") as folder:
        for cameras in args.cameras:
            recording = MadeUp(cameras, args.sets, args.size)
            backgrounds = recording.scene.backgrounds(6)
            bag = Path(folder) / f"bag{cameras}"
            write_bag(MadeUp(cameras, 1, args.size), bag, backgrounds=backgrounds)
            write_pose(bag / "start.yaml", recording.scene.body, recording.scene.pose(0))
            images, evidence, share = messages(recording, backgrounds)
            for rate in args.rates:
                for split, sets in ((False, images), (True, evidence)):
                    out = Path(folder) / f"{cameras}_{rate:g}_{split}"
                    count = round(args.seconds * rate)
                    found = run_given(bag, recording, rate, sets, out, count, split=split)
                    found["bandwidth_share"] = share if split else 1.0
                    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    sys.exit(main())
