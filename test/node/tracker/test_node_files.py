"""Result files of a running node: kill, full disk, time set back, an earlier result."""

import json
import resource
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import read_trc
from markerless_tracker.results.journal import read_summary


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_completes_the_result(number: int, tmp_path: Path, begin: Any) -> None:
    live = begin(result_file=tmp_path / "new" / "name.of", threads=0)
    stamps = [live.world.scene.stamp_ns(live.track()) for _ in range(2)]
    live.process.signal(number)
    assert live.process.wait() == 0, live.process.output
    assert "Traceback" not in live.process.output
    track = read_trc(tmp_path / "new" / "name.of.trc")
    assert track.names == MARKER_NAMES and track.stamps_ns.tolist() == stamps
    np.testing.assert_allclose(track.positions_m[-1], live.points(), atol=1e-6)
    summary = json.loads((tmp_path / "new" / "name.of.json").read_text())
    assert [frame["stamp_ns"] for frame in summary["frames"]] == stamps
    assert summary["node"]["tracked"] == "2" and summary["node"]["skipped"] == "0"
    assert not (tmp_path / "new" / "name.of.jsonl").exists()
    log = live.process.output
    for line in ("compiling", "ready, waiting for images", "person found", "2 frames written"):
        assert log.count(line) == 1, (line, log)


def test_a_killed_node_leaves_every_row(tmp_path: Path, begin: Any) -> None:
    live = begin(result_file=tmp_path / "walk", threads=0)
    stamps = [live.world.scene.stamp_ns(live.track()) for _ in range(3)]
    used = live.process.shared_memory()
    live.process.signal(signal.SIGKILL)
    live.process.wait()
    # The middleware had no chance to remove them.
    for path in used:
        path.unlink(missing_ok=True)
    assert read_trc(tmp_path / "walk.trc").stamps_ns.tolist() == stamps
    assert [f["stamp_ns"] for f in read_summary(tmp_path / "walk")["frames"]] == stamps


def test_time_set_back_begins_a_new_file_and_keeps_the_track(tmp_path: Path, begin: Any) -> None:
    live = begin(result_file=tmp_path / "walk")
    scene = live.world.scene
    shift_ns = 10**10
    before = [shift_ns + scene.stamp_ns(index) for index in range(4)]
    for index, stamp_ns in enumerate(before[:2]):
        live.track_at(index, stamp_ns)
    # One stamp alone is late, nothing else.
    live.camera.send(2, stamp_ns=0)
    live.until(lambda: live.value("late") == "1", "the late set")
    for index, stamp_ns in enumerate(before[2:], start=2):
        live.track_at(index, stamp_ns)
    for index in (4, 5):
        live.camera.send(index)
        live.until(lambda i=index: live.value("late") == str(i - 2), "a late set")
    for index in (6, 7):
        live.track_at(index, scene.stamp_ns(index))
        error = np.linalg.norm(live.points() - scene.markers(index), axis=1).mean()
        assert error < 0.03 and live.value("state") == "TRACKING"
    assert live.value("restarts") == "1"
    assert live.process.output.count("time was set back; the track goes on") == 1
    live.process.signal(signal.SIGINT)
    assert live.process.wait() == 0, live.process.output
    after = [scene.stamp_ns(index) for index in (6, 7)]
    assert read_trc(tmp_path / "walk.trc").stamps_ns.tolist() == before
    assert read_trc(tmp_path / "walk.2.trc").stamps_ns.tolist() == after
    summary = read_summary(tmp_path / "walk")
    assert [frame["stamp_ns"] for frame in summary["frames"]] == before + after
    assert summary["node"]["tracked"] == "6"


def test_a_full_disk_is_named_and_tracking_goes_on(tmp_path: Path, begin: Any) -> None:
    live = begin(result_file=tmp_path / "walk")
    live.track()
    _, hard = resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE)
    size = (tmp_path / "walk.jsonl").stat().st_size + 100
    resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE, (size, hard))
    index = live.track()
    says = f"result_file: {tmp_path / 'walk.jsonl'}: cannot be written: File too large; complete up"
    live.until(lambda: says in live.process.output, "the line")
    assert "tracking goes on" in live.process.output and live.value("state") == "TRACKING"
    assert len(read_trc(tmp_path / "walk.trc")) == 1
    resource.prlimit(live.process.pid, resource.RLIMIT_FSIZE, (hard, hard))
    last = live.track()
    live.process.signal(signal.SIGINT)
    assert live.process.wait() == 0, live.process.output
    stamps = [live.world.scene.stamp_ns(i) for i in (index - 1, last)]
    assert read_trc(tmp_path / "walk.trc").stamps_ns.tolist() == stamps
    assert read_summary(tmp_path / "walk")["not_written"] == 1


def test_an_earlier_result_is_kept_until_it_may_be_overwritten(
    tmp_path: Path, begin: Any, world: Any, start: Any
) -> None:
    (tmp_path / "walk.trc").write_text("earlier")
    refused = start("tracker", **world.parameters(), result_file=tmp_path / "walk")
    assert refused.wait() == 1
    (line,) = refused.output.splitlines()
    assert line == (
        f"tracker: result_file: {tmp_path / 'walk.trc'}: exists already, expected a new name or "
        "`overwrite`"
    )
    live = begin(result_file=tmp_path / "walk", overwrite=True)
    assert (tmp_path / "walk.trc").read_text() == "earlier"
    live.track()
    assert len(read_trc(tmp_path / "walk.trc")) == 1
