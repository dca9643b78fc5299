"""Figures of automatic starts."""

import numpy as np
import pytest

from markerless_tracker.benchmarks.starts import one_start, summarise
from markerless_tracker.benchmarks.with_truth import error_mm
from markerless_tracker.body import load_body, markers
from markerless_tracker.records import TrackResult, TrackState

BODY = load_body("balan31", 1.7)


def start(last: float | None, *, heading: float | None = 5.0, corrected: bool = False, first=40.0):
    return {
        "frame_mm": [first, last],
        "heading_deg": heading,
        "heading_corrected": corrected,
        "first_pose_s": None if first is None else 1.5,
    }


def test_fractions_refer_to_all_starts() -> None:
    figures = summarise(
        [start(30.0), start(80.0, corrected=True), start(300.0, heading=170.0),
         start(None, heading=None, first=None)]
    )  # fmt: skip
    assert figures["count"] == 4 and figures["found"] == 0.75
    assert figures["succeeded"] == 0.5 and figures["wrong_heading"] == 0.25
    assert figures["heading_corrected"] == 0.25
    assert figures["median_mm"] == 80.0 and figures["worst_mm"] == 300.0
    assert figures["first_mm"] == 40.0 and figures["first_pose_max_s"] == 1.5


def test_figures_without_any_success() -> None:
    figures = summarise([start(None, heading=None, first=None)])
    assert figures["found"] == figures["succeeded"] == 0.0
    assert figures["mean_mm"] is None and figures["first_pose_s"] is None


class Script:
    """A tracker that returns given poses."""

    def __init__(self, poses, warnings=()):
        self.poses, self.warnings, self.at = poses, warnings, 0

    def reset(self):
        self.at = 0

    def step(self, views, stamp_ns):
        pose = self.poses[self.at]
        self.at += 1
        return TrackResult(
            stamp_ns, TrackState.TRACKING if pose is not None else TrackState.SEARCHING, pose,
            None if pose is None else markers(BODY, pose), 1.0, {}, 0,
            warnings=self.warnings if self.at == 2 else (),
        )  # fmt: skip


@pytest.mark.parametrize(("rotation_deg", "expected"), [(0.0, 0.0), (170.0, 170.0), (-90.0, 90.0)])
def test_heading_and_error_are_the_last_frames(rotation_deg, expected) -> None:
    pose = BODY.neutral.copy()
    rotated = pose.copy()
    rotated[BODY.index("pelvis_rz")] += np.deg2rad(rotation_deg)
    truth = np.array([markers(BODY, pose)] * 3)
    figures = one_start(
        Script([None, pose, rotated], ("start: turned round",)), [(i, {}) for i in range(3)], truth
    )
    assert figures["frame_mm"][0] is None
    assert figures["frame_mm"][1] == pytest.approx(0.0, abs=1e-9)
    assert figures["heading_deg"] == pytest.approx(expected, abs=1e-6)
    assert figures["heading_corrected"] and figures["first_pose_s"] >= 0.0


def test_markers_without_truth_do_not_count() -> None:
    truth = markers(BODY, BODY.neutral)
    result = Script([BODY.neutral]).step({}, 0)
    truth[0] += (0.15, 0.0, 0.0)
    truth[1] = np.nan
    assert error_mm(result, truth) == pytest.approx(150.0 / 14.0)
    assert error_mm(result, np.full((15, 3), np.nan)) is None
