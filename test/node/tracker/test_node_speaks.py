"""What the node says in its log, over the real middleware: each event once, and the verdict."""

import json
import re
import signal
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.body import load_description, subject_from_stature, write_subject
from markerless_tracker.node.health import Level


def test_a_run_from_ready_to_the_result(tmp_path: Path, begin: Any, scenes: Any) -> None:
    live = begin(result_file=tmp_path / "walk", threads=0)
    live.until(lambda: "ready, " in live.process.output, "ready in the log")
    log = live.process.output
    assert re.search(r"ready, waiting for images; \d+ kernels compiled, \d+\.\d s", log), log
    live.track()
    live.until(lambda: "TRACKING: person found (stamp" in live.process.output, "found")
    live.send_until(
        lambda: "tracking without cam03" in live.message, "tracking without cam03", cam03=None
    )
    said = live.message
    live.until(lambda: f"]: {said}" in live.process.output, said)
    live.send_until(lambda: "every camera is used again" in live.process.output, "cam03 again")
    here = live.camera.scene
    live.camera.scene = scenes.EmptyRoom(here)
    messages: set[str] = set()

    def searching() -> bool:
        messages.add(live.message)
        return "SEARCHING: searching for a person (stamp" in live.process.output

    live.send_until(searching, "SEARCHING")
    live.camera.scene = here
    live.send_until(lambda: "person found again" in live.process.output, "found again")
    live.process.signal(signal.SIGINT)
    assert live.process.wait() == 0, live.process.output
    log = live.process.output
    # The diagnostics have the same words.
    assert "SEARCHING: searching for a person" in messages
    for line in (
        "compiling what is not", "TRACKING: person found (", "LOST: person lost (",
        "SEARCHING: searching for a person (", "TRACKING: person found again (",
        "TRACKING: tracking without cam03", "TRACKING: every camera is used again",
        "frames written", "sets of images not tracked: ",
        "overlap of body and silhouettes: cam01 0.", "debug/NAME/evidence show silhouettes",
    ):  # fmt: skip
        assert log.count(line) == 1, (line, log)
    verdict = json.loads((tmp_path / "walk.json").read_text(encoding="utf-8"))["verdict"]
    assert verdict["tracked"] > 0 and verdict["lost"] > 0 and verdict["searching"] > 0
    assert f"{verdict['frames']} frames, {verdict['tracked']} tracked" in log


def test_a_doubtful_calibration_is_said_before_the_run(
    tmp_path: Path, begin: Any, world: Any
) -> None:
    text = (world.folder / "calibration.toml").read_text(encoding="utf-8")
    path = tmp_path / "calibration.toml"
    path.write_text(
        re.sub(
            r"translation = \[(.*)\]",
            lambda found: (
                "translation = ["
                + ", ".join(str(1000.0 * float(value)) for value in found[1].split(","))
                + "]"
            ),
            text,
        ),
        encoding="utf-8",
    )
    live = begin(calibration_file=path)
    live.until(lambda: "ready, " in live.process.output, "ready in the log")
    log = live.process.output
    assert log.count("are the translations in millimetres instead of metres?") == 1
    assert log.index("millimetres") < log.index("ready, ")


def test_a_doubtful_run_is_said_while_it_runs(tmp_path: Path, begin: Any) -> None:
    # The subject of a child, and a grown person before the cameras.
    subject = subject_from_stature(load_description("balan31"), 1.30)
    write_subject(tmp_path / "subject.yaml", subject)
    live = begin(subject_file=tmp_path / "subject.yaml")
    live.until(lambda: "ready, " in live.process.output, "ready in the log")
    live.send_until(lambda: "TRACKING: doubt: " in live.message, "a doubt")
    assert live.level == Level.WARN.value
    assert "stature of 1.30 m" in live.value("doubts")
    live.send_until(lambda: "doubt: the body has" in live.process.output, "in the log, too")
