"""Bags after damage: cut at random bytes; `convert` and `record` killed at random moments.

Every check is exact: images that are read have the bytes that were written. `record` needs ROS 2.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from markerless_tracker.benchmarks.machine import machine
from markerless_tracker.datasets import Recording, new_recording, open_recording
from markerless_tracker.datasets.bag.stream import McapFiles
from markerless_tracker.errors import DatasetError
from markerless_tracker.synthesis.rig import ring_rig

ROOT = Path(__file__).resolve().parent.parent.parent
SIZE_PX = (320, 240)
EARLIER, LATER = 5, 240
VERB = [sys.executable, "-m", "markerless_tracker"]
PARTS = ("cuts", "convert", "record")


def picture(camera: int, number: int) -> np.ndarray:
    """An image that no other set has."""
    rng = np.random.default_rng([camera, number])
    small = rng.integers(0, 256, (SIZE_PX[1] // 16, SIZE_PX[0] // 16, 3), dtype=np.uint8)
    return np.ascontiguousarray(small.repeat(16, axis=0).repeat(16, axis=1))


def source(folder: Path, sets: int) -> Path:
    """A lossless recording of two cameras."""
    path = folder / f"videos_{sets}"
    rig = ring_rig(2, SIZE_PX)
    with new_recording(path, rig, 60.0, lossless=True) as out:
        for camera, name in enumerate(rig.names):
            out.write_background(name, [picture(camera, 10**6)])
        for number in range(sets):
            out.write({name: picture(camera, number) for camera, name in enumerate(rig.names)})
    return path


def call(*words: object) -> None:
    """A verb as a process; ends the script if it fails."""
    done = subprocess.run([*VERB, *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)


def check_sets(recording: Recording, period_ns: float) -> int:
    """Number of sets; their images are those of their stamps."""
    count = 0
    for frame in recording.frames():
        number = round(frame.stamp_ns / period_ns)
        for camera, name in enumerate(recording.rig.names):
            np.testing.assert_array_equal(frame.images[name], picture(camera, number))
        count += 1
    return count


def stored(file: Path) -> Iterator[tuple[int, bytes]]:
    """Data of each message of a whole bag, and the byte behind the last that it needs."""
    content = file.read_bytes()
    at = 0
    with file.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if not isinstance(record, Chunk):
                continue
            chunk = content.index(record.data, at)
            at = chunk + len(record.data)
            inside = 0
            for message in breakup_chunk(record):
                if not isinstance(message, Message):
                    continue
                if record.compression:
                    yield at, message.data
                else:
                    inside = record.data.index(message.data, inside) + len(message.data)
                    yield chunk + inside, message.data


def cuts(work: Path, count: int, rng: random.Random) -> dict[str, Any]:
    """Bags of each compression, cut at random bytes: all intact messages are read."""
    videos, seconds, lost, beyond = source(work, 40), [], 0, 0
    kinds = ("none", "zstd", "png", "jpeg")
    for kind in kinds:
        bag = work / f"bag_{kind}"
        call("convert", videos, bag, "--compress", kind)
        (file,) = bag.glob("*.mcap")
        content, known = file.read_bytes(), list(stored(file))
        for _ in range(count // len(kinds)):
            size = rng.randrange(len(content))
            file.write_bytes(content[:size])
            intact = [data for end, data in known if end <= size]
            started = time.perf_counter()
            try:
                found = [message.data for message in McapFiles([file])]
            except DatasetError:
                assert size < 8
                continue
            lost += len(intact) - min(len(found), len(intact))
            beyond += max(0, len(found) - len(intact))
            assert found == [data for _, data in known[: len(found)]]
            try:
                recording = open_recording(bag)
            except DatasetError as error:
                assert "\n" not in str(error)
            else:
                if kind != "jpeg":
                    check_sets(recording, 1e9 / 60.0)
            seconds.append(time.perf_counter() - started)
    return {"cuts": count, "messages_lost": lost, "more_of_cut_chunks": beyond,
            "longest_s": round(max(seconds), 2)}  # fmt: skip


def convert(work: Path, count: int, rng: random.Random) -> dict[str, Any]:
    """`convert` killed at random moments, over an earlier bag and without one."""
    short, longer = source(work, EARLIER), source(work, LATER)
    earlier, bag = work / "earlier", work / "bag"
    call("convert", short, earlier)
    began = time.perf_counter()
    call("convert", longer, bag)
    whole_s = time.perf_counter() - began
    outcomes = {"earlier": 0, "new": 0, "none": 0}
    for number in range(count):
        shutil.rmtree(bag, ignore_errors=True)
        if number % 2:
            shutil.copytree(earlier, bag)
        process = subprocess.Popen(
            [*VERB, "convert", str(longer), str(bag), "--force"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        # Until the end more often than not: the exchange of the folders is the critical moment.
        time.sleep(rng.uniform(0.3, 1.1) * whole_s)
        process.send_signal(signal.SIGKILL)
        process.wait()
        if not bag.exists():
            assert not number % 2, "the earlier bag is gone"
            outcomes["none"] += 1
            continue
        recording = open_recording(bag)
        sets = check_sets(recording, 1e9 / 60.0)
        assert recording.warnings == () and sets in (EARLIER, LATER), recording.warnings
        outcomes["earlier" if sets == EARLIER else "new"] += 1
    return {"kills": count, **outcomes}


def record(work: Path, count: int, rng: random.Random) -> dict[str, Any]:
    """`record` killed at random moments while images arrive."""
    import rclpy
    from sensor_msgs.msg import Image

    from markerless_tracker.camera import write_calibration
    from markerless_tracker.node.ros.images import fill_image
    from markerless_tracker.node.ros.profile import apply_profile
    from markerless_tracker.node.ros.qos import image_qos
    from markerless_tracker.node.ros.stamps import time_message

    rig, period_ns = ring_rig(2, SIZE_PX), 50_000_000
    calibration = work / "calibration.toml"
    write_calibration(calibration, rig)
    # A graph of its own, whatever else runs on this machine.
    os.environ["ROS_DOMAIN_ID"] = str(rng.randrange(1, 100))
    apply_profile()
    rclpy.init()
    node = rclpy.create_node("cameras")
    publishers = [node.create_publisher(Image, f"{n}/image_raw", image_qos()) for n in rig.names]
    missing, sets = [], []
    for number in range(count):
        bag = work / f"recorded_{number}"
        process = subprocess.Popen(
            [*VERB, "record", str(bag)]
            + ["--calibration", str(calibration), "--topics", "cam01/image_raw,cam02/image_raw"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        while not all(p.get_subscription_count() for p in publishers):
            assert process.poll() is None, "record ended"
            rclpy.spin_once(node, timeout_sec=0.05)
        sent, until = 0, time.monotonic() + rng.uniform(0.1, 5.0)
        while time.monotonic() < until:
            for camera, publisher in enumerate(publishers):
                message = fill_image(Image(), picture(camera, sent), rig.names[camera])
                message.header.stamp = time_message(sent * period_ns)
                publisher.publish(message)
            sent += 1
            rclpy.spin_once(node, timeout_sec=period_ns / 1e9)
        process.send_signal(signal.SIGKILL)
        process.wait()
        (file,) = bag.glob("*.mcap")
        held = sum(1 for _ in McapFiles([file])) // 2 if file.stat().st_size > 8 else 0
        # Of a file with fewer than two sets no rate is known; it opens all the same.
        read = check_sets(open_recording(bag), period_ns) if held else 0
        assert read == held, (read, held)
        missing.append((sent - read) * period_ns / 1e9)
        sets.append(read)
        while any(p.get_subscription_count() for p in publishers):
            rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.shutdown()
    return {"kills": count, "sets_read": sum(sets), "most_lost_s": round(max(missing), 2)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", dest="out", type=Path, default=ROOT / "out" / "bags")
    args = parser.parse_args()
    figures: dict[str, Any] = {"machine": machine(), "seed": args.seed}
    for part in args.parts or PARTS:
        work = args.out / f"kills_{os.getpid()}"
        work.mkdir(parents=True)
        rng = random.Random(args.seed)
        try:
            if part == "cuts":
                figures[part] = cuts(work, args.cuts, rng)
            elif part == "convert":
                figures[part] = convert(work, args.kills, rng)
            elif part == "record":
                figures[part] = record(work, args.kills, rng)
            else:
                parser.error(f"part {part}: expected some of {', '.join(PARTS)}")
        finally:
            shutil.rmtree(work)
        print(json.dumps({part: figures[part]}), flush=True)
    (args.out / "kills.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
