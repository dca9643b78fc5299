"""Kills, signals and long runs of a tracker; minutes each, but for the shape of the scripts."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.datasets import read_trc

ROOT = Path(__file__).resolve().parents[4]
SCRIPTS = ROOT / "bench" / "live"


def run_script(name: str, *words: str, limit_s: float) -> tuple[int, dict[str, Any]]:
    environment = {key: v for key, v in os.environ.items() if key != "ROS_PYTHON_CHECK_FIELDS"}
    done = subprocess.run(
        [sys.executable, str(SCRIPTS / name), *words, "--json"],
        capture_output=True, text=True, timeout=limit_s,
        env={**environment, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode in (0, 3), done.stderr[-3000:]
    return done.returncode, json.loads(done.stdout)


@pytest.mark.long
def test_two_minutes_in_lockstep_leave_memory_threads_and_files_as_they_were() -> None:
    status, report = run_script("soak.py", "--minutes", "2", "--lockstep", limit_s=1800.0)
    assert status == 0 and report["red"] == [], report
    assert report["growth"]["memory"] < 0.01, report
    assert {report["growth"][name] for name in ("threads", "files", "shared")} == {0.0}
    assert report["counts"]["state"] == "TRACKING" and report["counts"]["skipped"] == "0"


def namespaces() -> str:
    """Why there can be no network namespaces here; empty if there can."""
    for tool in ("unshare", "nsenter", "ip"):
        if shutil.which(tool) is None:
            return f"{tool} is not installed"
    made = "ip link set lo up && test -c /dev/net/tun && ip tuntap add dev t0 mode tap"
    done = subprocess.run(["unshare", "-rn", "sh", "-c", made], capture_output=True, text=True)
    return "" if done.returncode == 0 else f"no network namespaces: {done.stderr.strip()}"


@pytest.mark.long
def test_eight_cameras_behind_a_link_that_loses_frames_give_the_poses_of_images() -> None:
    """The tracker lies in a network namespace of its own: five frames of a hundred are lost."""
    reason = namespaces()
    if reason:
        pytest.skip(reason)
    _, report = run_script(
        "split.py", "--cameras", "8", "--rates", "0", "--sets", "25", "--size", "328x245",
        "--loss", "0.05", limit_s=1800.0,
    )  # fmt: skip
    single, split = report["runs"]
    assert split["tracked"] == single["tracked"] == 25 and split["same_result"]
    assert split["bandwidth_share"] < 0.03 and split["dropped"] == 0
    link = report["link"]
    assert 0.02 < link["dropped"] / link["frames"] < 0.08


@pytest.mark.long
def test_a_signal_while_a_person_is_searched_ends_with_whole_files(
    tmp_path: Path, begin: Any
) -> None:
    live = begin(start_file=None, result_file=tmp_path / "walk", threads=0)
    live.camera.send(0)
    live.until(lambda: live.value("activity") == "processing images", "the search to begin")
    live.process.signal(signal.SIGTERM)
    assert live.process.wait() == 0, live.process.output
    assert "Traceback" not in live.process.output
    assert json.loads((tmp_path / "walk.json").read_text())["node"]["tracked"] in ("0", "1")


@pytest.mark.long
def test_a_killed_tracker_that_is_started_again_goes_on(tmp_path: Path, begin: Any) -> None:
    live = begin(result_file=tmp_path / "first", threads=0)
    before = [live.world.scene.stamp_ns(live.track()) for _ in range(4)]
    live.process.signal(signal.SIGKILL)
    live.process.wait()
    again = begin(result_file=tmp_path / "second", threads=0)
    again.next = live.next
    after = [again.world.scene.stamp_ns(again.track()) for _ in range(4)]
    again.process.signal(signal.SIGINT)
    assert again.process.wait() == 0
    assert read_trc(tmp_path / "first.trc").stamps_ns.tolist() == before
    assert read_trc(tmp_path / "second.trc").stamps_ns.tolist() == after


def test_the_scripts_name_what_exists() -> None:
    """The long tests run them; their words are checked here."""
    for name in ("soak.py", "split.py"):
        text = (SCRIPTS / name).read_text()
        for module in re.findall(r"^from (markerless_tracker[\w.]+) import", text, re.MULTILINE):
            assert ROOT.joinpath(*module.split(".")).with_suffix(".py").is_file() or (
                ROOT.joinpath(*module.split("."), "__init__.py").is_file()
            ), module
    assert (SCRIPTS / "forward.py").is_file()
