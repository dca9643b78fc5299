"""Log lines of a running tracker and its doubts about the run, without the middleware."""

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from markerless_tracker.body import markers
from markerless_tracker.calibration.contours.time_offset import TimeOffset
from markerless_tracker.node.health import Facts, Health, Level, assess
from markerless_tracker.node.ros.notices import Notices
from markerless_tracker.node.tracker.announcer import Announcer, CompilingLines, ready_line
from markerless_tracker.node.tracker.cameras.counts import SyncCounts
from markerless_tracker.node.tracker.report import LOOK_NS, RunReport, sets_line
from markerless_tracker.node.tracker.status import TrackerStatus
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig

FRAME_NS = LOOK_NS // 10
TRACKING, LOST, SEARCHING = TrackState.TRACKING, TrackState.LOST, TrackState.SEARCHING

CAMERAS = ("cam01", "cam02")


def facts(**changes: Any) -> Facts:
    """A tracker that tracks; with changes."""
    fine = {
        "ready": True, "activity": "processing images", "state": TRACKING, "cameras": CAMERAS,
        "ready_age_s": 60.0, "set_age_s": 0.0, "result_age_s": 0.0,
    }  # fmt: skip
    return Facts(**{**fine, **changes})


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []
        self.warnings: list[str] = []
        self.now_s = 0.0
        self.news = Notices(self.lines.append, lambda: self.now_s)
        self.announcer = Announcer(self.news, Notices(self.warnings.append, lambda: self.now_s))

    def results(self, *states: TrackState, seconds: float = 20.0) -> None:
        """Results that follow each other at that distance."""
        for state in states:
            self.now_s += seconds
            self.announcer.result(TrackResult(int(self.now_s), state, None, None, math.nan, {}, 0))


def test_found_lost_and_found_again_once_each() -> None:
    log = Log()
    log.results(SEARCHING, SEARCHING, TRACKING, TRACKING, LOST, LOST, SEARCHING, TRACKING, TRACKING)
    assert log.lines == [
        "TRACKING: person found (stamp 60)",
        "LOST: person lost (stamp 100)",
        "SEARCHING: searching for a person (stamp 140)",
        "TRACKING: person found again (stamp 160)",
    ]
    assert log.warnings == []


def test_a_state_that_changes_all_the_time_does_not_fill_the_log() -> None:
    log = Log()
    log.results(*([TRACKING, LOST] * 50), seconds=0.01)
    assert len(log.lines) == 3
    log.now_s += 20.0
    log.news.flush()
    assert [line for line in log.lines[3:] if "times in 10 s" in line] == log.lines[3:] != []


def test_each_kind_of_doubt_is_said_once() -> None:
    log = Log()
    for overlap in (0.71, 0.73):
        log.now_s += 60.0
        log.announcer.doubts((f"body and silhouettes overlap by {overlap}", "too low"))
    assert log.warnings == ["doubt: body and silhouettes overlap by 0.71", "doubt: too low"]


def test_skipped_sets_are_said_once() -> None:
    log = Log()
    log.results(TRACKING)
    for share in (None, 0.6, 0.2, 0.8):
        log.now_s += 60.0
        log.announcer.health(assess(facts(skipped=share)))
    assert log.warnings == [
        "60 % of the sets are skipped: they come faster than this machine tracks them"
    ]


def test_a_camera_that_is_gone_and_back_is_said_once_each() -> None:
    log = Log()
    log.results(TRACKING)
    whole = Health(Level.OK, "TRACKING", "", "")
    words = "tracking without cam02: no image of cam02"
    gone = Health(Level.WARN, f"TRACKING: {words}", "", words)
    for health in (whole, gone, gone, gone, whole, whole):
        log.announcer.health(health)
    assert log.warnings == [gone.message]
    assert log.lines[1:] == ["TRACKING: every camera is used again"]


def test_what_is_not_known_is_no_recovery() -> None:
    """A camera that is left out, then no image at all, then sets that are not tracked yet."""
    log = Log()
    log.results(TRACKING)
    words = "tracking without cam02: no image of cam02"
    stale = assess(facts(set_age_s=9.0, result_age_s=9.0, silent=CAMERAS))
    waits = assess(facts(result_age_s=None, activity="waiting for learn_background"))
    for health in (Health(Level.WARN, f"TRACKING: {words}", "", words), stale, waits):
        log.announcer.health(health)
    assert log.lines[1:] == [] and len(log.warnings) == 2
    log.announcer.health(assess(facts()))
    assert log.lines[1:] == ["TRACKING: every camera is used again", "images are tracked"]


@pytest.mark.parametrize(("terminal", "more"), [(True, 4), (False, 0)])
def test_a_first_start_is_two_lines_and_progress_in_a_terminal(terminal: bool, more: int) -> None:
    lines: list[str] = []
    now_s = 100.0
    compiling = CompilingLines(lines.append, lambda: now_s, terminal=terminal)
    for done in range(90):
        now_s += 1.0
        compiling.progress(f"compiling {done} of at most 120 kernels")
    first, long, *progress = lines
    assert first == "compiling what is not stored from an earlier start"
    assert long.startswith("compiling 4 of at most 120 kernels, which takes about half a minute")
    assert "`markerless_tracker compile`" in long
    assert progress == [
        f"compiling {done} of at most 120 kernels" for done in (24, 44, 64, 84)[:more]
    ]


def test_the_duration_of_the_compilation() -> None:
    line = ready_line("waiting for images", 12, 34.56)
    assert line == "ready, waiting for images; 12 kernels compiled, 34.6 s"


def test_a_late_camera_is_said_once_with_the_offsets_that_correct_it() -> None:
    log = Log()
    given_s = {"cam01": 0.0, "cam02": 0.01, "cam03": 0.0}
    sure, unsure = TimeOffset(0.02, 0.001), TimeOffset(0.02, 0.01)
    log.announcer.time_offsets({"cam02": unsure, "cam03": TimeOffset(0.004, 0.0001)}, given_s)
    assert log.warnings == []
    for _ in range(3):
        log.announcer.time_offsets({"cam01": unsure, "cam02": sure}, given_s)
    assert log.warnings == [
        "images are late, by the person's motion: cam02 by +20 ms (sd 1.0 ms); "
        'stamp_offsets:="[0.000, 0.030, 0.000]" corrects it'
    ]


def test_the_sets_that_were_not_tracked_are_counted() -> None:
    status = TrackerStatus()
    status.became_ready("waiting for images", now_s=0.0)
    assert sets_line(status.values(SyncCounts(), (), ())) == (
        "sets of images not tracked: 0 skipped for newer ones"
    )
    status.dropped("before_ready", 4)
    counts = SyncCounts(complete=20, skipped=7, incomplete=2)
    assert sets_line(status.values(counts, (), ())) == (
        "sets of images not tracked: 7 skipped for newer ones, 2 incomplete, "
        "4 before the tracker was ready"
    )


def report_and_scene() -> tuple[RunReport, SyntheticScene]:
    scene = SyntheticScene(body="person32", size_px=(64, 48), fps=30.0, samples=2, motion="stand")
    report = RunReport(start_given=False)
    tracker = Tracker(scene.rig, scene.body, TrackerConfig(body="person32"))
    assert report.begin(tracker, scene.rig) == ()
    return report, scene


def result(
    scene: SyntheticScene, frame: int, overlap: float, state: TrackState = TRACKING
) -> TrackResult:
    pose, masks = scene.pose(0), scene.frame(0)[1]
    seen = {
        name: Observation.from_mask(name, frame * FRAME_NS, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    return TrackResult(
        frame * FRAME_NS, state, pose, markers(scene.body, pose), 1.0,
        dict.fromkeys(scene.rig.names, overlap), 0, observations=seen,
    )  # fmt: skip


def test_a_run_is_looked_at_after_some_time() -> None:
    report, scene = report_and_scene()
    for frame in range(11):
        assert report.doubts == ()
        report.add(result(scene, frame, 0.5), scene.body)
    assert report.doubts[0].startswith("body and silhouettes overlap by 0.5")
    verdict = report.verdict()
    assert verdict is not None and verdict.doubts == report.doubts


def test_while_nobody_was_tracked_no_causes_are_sought(monkeypatch: pytest.MonkeyPatch) -> None:
    report, scene = report_and_scene()
    with monkeypatch.context() as patched:
        patched.delattr("markerless_tracker.node.tracker.report.verdict_of")
        for frame in range(21):
            report.add(result(scene, frame, 0.5, LOST), scene.body)
    assert report.doubts == ()
    verdict = report.verdict()
    assert verdict is not None and verdict.causes


def test_a_doubt_ends_when_most_of_the_run_is_well() -> None:
    report, scene = report_and_scene()
    overlaps = [0.5] * 11 + [0.9] * 30
    for frame, overlap in enumerate(overlaps):
        report.add(result(scene, frame, overlap), scene.body)
    assert not any("overlap" in doubt for doubt in report.doubts)


def test_stamps_that_run_backwards_do_not_end_the_looks() -> None:
    report, scene = report_and_scene()
    report.add(result(scene, 1000, 0.5), scene.body)
    report.add(result(scene, 0, 0.5), scene.body)
    assert report.doubts
