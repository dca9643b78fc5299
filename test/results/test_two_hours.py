"""A made-up result of two hours: memory stays flat while it is written, read and exported."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body, markers
from markerless_tracker.datasets.markers.trc import TrcRows
from markerless_tracker.records import Confidence, LimbState, TrackResult, TrackState
from markerless_tracker.results.export.formats import EXPORTS
from markerless_tracker.results.read import ResultReader
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.tracking import TrackerConfig

TWO_HOURS = 432_000
PERIOD_NS = 16_666_667
QUICK = ("npz",)
EVERY_FORMAT = tuple(EXPORTS)
_POSES = 64
_CAMERAS = ("cam01", "cam02", "cam03", "cam04")


def frame(number: int, poses: np.ndarray, places: np.ndarray, sure: Confidence) -> TrackResult:
    """Frame of a periodic motion with everything that a real one has; some are lost."""
    lost = number % 1000 in range(990, 1000)
    turn = number % len(poses)
    return TrackResult(
        stamp_ns=number * PERIOD_NS,
        state=TrackState.LOST if lost else TrackState.TRACKING,
        pose=None if lost else poses[turn],
        markers_m=None if lost else places[turn],
        fitness=float("nan") if lost else 0.95,
        iou=dict.fromkeys(_CAMERAS, 0.912345678),
        evaluations=1000,
        refinements=4,
        warnings=("cam01: 12 px of silhouette away from the body left out",) * (turn == 0),
        confidence=None if lost else sure,
        limbs=dict.fromkeys(
            ("l_arm", "r_arm", "l_leg", "r_leg"), LimbState(TrackState.TRACKING, 0.98, 0.4)
        ),
        exposure=dict.fromkeys(_CAMERAS, (1.0, 0.99, 1.01)),
    )


def person() -> tuple[BodyModel, np.ndarray, np.ndarray, Confidence]:
    """A body, its poses (n, p), their markers (n, 15, 3) and how sure they are."""
    body = load_body("person32", 1.75)
    rng = np.random.default_rng(3)
    turns = np.sin(np.linspace(0.0, 2.0 * np.pi, _POSES, endpoint=False))
    poses = body.neutral + 0.2 * turns[:, None] * rng.normal(size=body.size)
    places = np.stack([markers(body, pose) for pose in poses])
    sure = Confidence(np.full(body.size, 0.02), np.full((15, 3), 0.008), np.eye(6))
    return body, poses, places, sure


def write_and_export(name: Path, frames: int, formats: tuple[str, ...]) -> dict[str, Any]:
    """Write a result of that length and export it; returns the memory and the time of each stage.

    Returns:
        `peaks_mib`: peak of memory until then; `cpu_s`: CPU time until then; `tracked`: frames.
    """
    body, poses, places, sure = person()
    config = TrackerConfig.from_mapping({"body": "person32"})
    peaks = {}
    with ResultWriter(name, body, config, fps=60.0, source="two hours") as writer:
        for number in range(frames):
            if number == min(2000, frames // 4):
                peaks["begun"] = peak_mib()
            writer.add(frame(number, poses, places, sure))
        peaks["frames written"] = peak_mib()
    peaks["closed"] = peak_mib()
    cpu_s = {"written": time.process_time()}
    reader = ResultReader(name)
    tracked = sum(int(part.tracked.sum()) for part in reader.chunks())
    peaks["read"] = peak_mib()
    cpu_s["read"] = time.process_time()
    for kind in formats:
        EXPORTS[kind](name.with_name(f"{name.name}_{kind}.{kind}"), reader, reader.marker_names)
        peaks[kind] = peak_mib()
        cpu_s[kind] = time.process_time()
    return {"peaks_mib": peaks, "cpu_s": cpu_s, "tracked": tracked}


def peak_mib() -> float:
    """Most memory that this process has had resident so far.

    `resource.getrusage` would count that of the process which started this one.
    """
    text = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(text.split("VmHWM:")[1].split()[0]) / 1024.0


def in_a_process(name: Path, frames: int, formats: tuple[str, ...], root: Path) -> dict[str, Any]:
    """`write_and_export` in a process of its own, whose memory is nobody else's."""
    code = (
        "import sys, json, pathlib, test_two_hours as t\n"
        "name, frames, *formats = sys.argv[1:]\n"
        "found = t.write_and_export(pathlib.Path(name), int(frames), tuple(formats))\n"
        "print(json.dumps(found))\n"
    )
    paths = os.pathsep.join([str(root), str(Path(__file__).parent)])
    done = subprocess.run(
        [sys.executable, "-c", code, str(name), str(frames), *formats],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def opens(name: Path, frames: int) -> None:
    """The marker file has every row, and its header says so."""
    with TrcRows(name.with_name(name.name + ".trc")) as rows:
        count = sum(len(stamps) for stamps, _ in rows.chunks())
    assert count == frames
    with name.with_name(name.name + ".trc").open(encoding="utf-8") as lines:
        assert [next(lines) for _ in range(3)][2].split("\t")[2] == str(frames)


def test_a_short_result_in_the_same_way(tmp_path: Path, project_root: Path) -> None:
    frames = 4000
    found = in_a_process(tmp_path / "long", frames, QUICK, project_root)
    opens(tmp_path / "long", frames)
    assert found["tracked"] == frames - 10 * (frames // 1000)
    peaks = found["peaks_mib"]
    assert peaks["closed"] - peaks["begun"] < 20.0


@pytest.mark.long
def test_two_hours(tmp_path: Path, project_root: Path) -> None:
    found = in_a_process(tmp_path / "long", TWO_HOURS, EVERY_FORMAT, project_root)
    opens(tmp_path / "long", TWO_HOURS)
    assert found["tracked"] == TWO_HOURS - 10 * (TWO_HOURS // 1000)
    peaks = found["peaks_mib"]
    assert peaks["closed"] - peaks["begun"] < 20.0
    assert peaks["read"] - peaks["begun"] < 200.0
    assert max(peaks.values()) - peaks["begun"] < 400.0
