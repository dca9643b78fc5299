"""The verdict of made-up runs."""

import json
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from markerless_tracker.body import Subject, load_body, load_description
from markerless_tracker.camera import CameraRig
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.results.verdict.record import RunRecord
from markerless_tracker.results.verdict.verdict import Verdict, fits_worst, verdict_of

TRACKING, LOST, SEARCHING = TrackState.TRACKING, TrackState.LOST, TrackState.SEARCHING

Judge = Callable[..., Verdict]


@pytest.fixture
def judge(scene: Any) -> Judge:
    """`judge(results, body=, of=, **options)`: the verdict; `of` names the body's description."""

    def make(
        results: list[TrackResult], body: Any = None, *, of: str = "person32", **options: Any
    ) -> Verdict:
        record = RunRecord(scene.rig)
        for result in results:
            record.add(result, body or scene.body)
        return verdict_of(record, load_description(of), **options)

    return make


def test_a_good_run_has_no_doubt(judge: Judge, result: Any) -> None:
    found = judge([result(index) for index in range(10)])
    assert found.doubts == found.causes == ()
    assert (found.frames, found.tracked, found.lost, found.searching) == (10, 10, 0, 0)
    assert found.counts == "10 frames, 10 tracked, 0 lost, 0 searching"
    assert found.overlap == {f"cam0{n}": pytest.approx(0.9, abs=0.005) for n in range(1, 5)}
    assert found.stature_m == pytest.approx(1.72, abs=0.01) and found.stature_plausible
    assert found.worst_limb == "" and found.frames_with_warnings == 0
    lines = found.lines()
    assert lines[0].startswith("overlap of body and silhouettes: cam01 0.90, cam02 0.90")
    assert lines[1] == "stature of the body 1.72 m"
    assert lines[-1].startswith("next: `track") and len(lines) == 3
    assert json.loads(json.dumps(found.as_mapping()))["stature_m"] == 1.72


def test_states_limbs_warnings_and_where_to_look(judge: Judge, result: Any) -> None:
    states = [SEARCHING, SEARCHING, TRACKING, LOST, TRACKING, LOST, LOST, SEARCHING, TRACKING]
    found = judge(
        [
            result(index, state, lost=("r_arm",) if index > 3 else (), warnings=(f"a: {index} px",))
            for index, state in enumerate(states)
        ]
    )
    assert found.counts == "9 frames, 3 tracked, 3 lost, 3 searching"
    # Only tracked frames count for the limbs, and only what follows the first of them is a loss.
    assert (found.worst_limb, found.worst_limb_lost) == ("r_arm", 2)
    assert "worst limb: right arm, lost in 2 of 3 tracked frames" in found.lines()
    assert "warnings in 9 frames: 1 kind" in found.lines()
    assert found.look.startswith("nobody was tracked from 0.50 to 0.70 s (3 frames)")


def test_a_start_pose_that_fits_late_is_doubted(judge: Judge, result: Any) -> None:
    results = [result(index, SEARCHING if index < 4 else TRACKING) for index in range(6)]
    found = judge(results, start_given=True)
    assert found.doubts[0].startswith("nobody was tracked in the first 4 frames although a start")
    assert found.look.startswith("nobody was tracked from 0.00 to 0.30 s (4 frames)")
    assert judge(results).doubts == ()
    assert judge(results[4:], start_given=True).doubts == ()


def test_what_was_known_before_stays_first(judge: Judge, result: Any) -> None:
    found = judge([result(0, raised_m=0.9)], known=("said before",))
    assert found.doubts[0] == "said before" and len(found.doubts) == 2


@pytest.mark.parametrize(("raised_m", "at"), [(0.9, "0.99"), (0.2, "0.29"), (-0.11, "-0.02")])
def test_a_person_where_no_floor_is(judge: Judge, result: Any, raised_m: float, at: str) -> None:
    (doubt,) = judge([result(index, raised_m=raised_m) for index in range(3)]).doubts
    assert doubt.startswith(
        f"the lowest joint of a standing person is at z = {at} m, expected 0.01"
    )
    assert "is the floor of the calibration's world at z = 0, and z up, or " in doubt
    asked = "does the person stand on something?" if raised_m > 0.0 else "is the subject another's?"
    assert doubt.endswith(asked)


@pytest.mark.parametrize("raised_m", [-0.04, 0.0, 0.1])
def test_shoes_mats_and_jumps_are_no_doubt(judge: Judge, result: Any, raised_m: float) -> None:
    results = [result(index, raised_m=raised_m) for index in range(6)]
    results += [result(index, raised_m=raised_m + 0.5) for index in range(6, 10)]
    assert judge(results).doubts == ()


@pytest.mark.parametrize(("size", "doubted"), [(0.92, True), (1.0, False)])
def test_silhouettes_that_reach_beyond_a_body_that_is_too_small(
    judge: Judge, result: Any, scene: Any, size: float, doubted: bool
) -> None:
    lengths = {name: size * value for name, value in scene.body.lengths_m.items()}
    body = load_body("person32", Subject("smaller", lengths))
    found = judge([result(index) for index in range(8)], body)
    assert bool(found.doubts) == doubted, found.doubts
    if doubted:
        assert re.match(r"the silhouettes reach \d+ mm beyond the body", found.doubts[0])
        assert "is the subject, or the stature given, this person's" in found.doubts[0]
    assert judge([result(index) for index in range(3)], body).doubts == ()


def test_a_body_without_feet_stands_on_nothing(judge: Judge, result: Any) -> None:
    sunk = [result(index, raised_m=-0.2) for index in range(3)]
    assert judge(sunk, load_body("balan31"), of="balan31").doubts == ()
    assert judge(sunk).doubts != ()


def test_a_low_overlap(judge: Judge, result: Any) -> None:
    (doubt,) = judge([result(index, overlap=0.7) for index in range(3)]).doubts
    assert doubt.startswith("body and silhouettes overlap by 0.7")


def test_a_camera_that_contradicts_is_named(judge: Judge, result: Any) -> None:
    overlap = {"cam01": 0.9, "cam02": 0.4, "cam03": 0.9, "cam04": 0.85}
    (doubt,) = judge([result(index, overlap=overlap) for index in range(3)]).doubts
    assert doubt.startswith("cam02 contradicts the other cameras: overlap 0.40, theirs 0.90")


def test_a_camera_that_is_not_used_is_named(judge: Judge, result: Any) -> None:
    overlap = {"cam01": 0.9, "cam03": 0.9, "cam04": 0.85}
    (doubt,) = judge([result(index, overlap=overlap) for index in range(3)]).doubts
    assert doubt.startswith("cam02 was used in 0 of 3 poses only")


@pytest.mark.parametrize(("stature", "doubted"), [(1.54, True), (1.72, False), (1.93, True)])
def test_where_the_body_fits_badly_few_statures_are_believed(
    judge: Judge, result: Any, stature: float, doubted: bool
) -> None:
    doubts = judge([result(0, overlap=0.65)], load_body("person32", stature)).doubts
    assert any(f"a stature of {stature:.2f} m" in doubt for doubt in doubts) == doubted


@pytest.mark.parametrize(
    ("stature", "overlap", "doubted"),
    [(1.20, 0.95, True), (1.46, 0.95, False), (1.46, 0.80, True), (2.03, 0.80, True),
     (1.85, 0.80, False), (1.54, 0.80, False), (2.20, 0.95, True)],
)  # fmt: skip
def test_statures(judge: Judge, result: Any, stature: float, overlap: float, doubted: bool) -> None:
    body = load_body("person32", stature)
    found = judge([result(0, overlap=overlap)], body)
    assert found.stature_m == pytest.approx(stature, abs=0.01)
    assert bool(found.doubts) == doubted, found.doubts
    if doubted:
        assert f"the body has a stature of {stature:.2f} m" in found.doubts[0]


def test_odd_proportions(judge: Judge, result: Any, scene: Any) -> None:
    odd = {**scene.body.lengths_m, "torso": 0.40}
    (doubt,) = judge([result(0)], load_body("person32", Subject("odd", odd))).doubts
    assert "lengths unlike those of a person of" in doubt and "torso 0.40 m (7" in doubt


def nobody(result: Any, shown: Any = None) -> list[TrackResult]:
    return [result(index, SEARCHING, shown=shown) for index in range(4)]


def blank(masks: Any, value: bool) -> dict[str, Any]:
    return {name: np.full(mask.shape, value) for name, mask in masks[0].items()}


def test_nobody_and_no_silhouette(judge: Judge, result: Any, masks: Any) -> None:
    found = judge(nobody(result, blank(masks, False)))
    assert found.doubts == () and found.tracked == 0 and found.stature_m is None
    (cause,) = found.causes
    assert cause.startswith("no silhouette in any camera: nobody is there")
    assert f"likely cause: {cause}" in found.lines()


def test_nobody_and_silhouettes_everywhere(judge: Judge, result: Any, masks: Any) -> None:
    causes = judge(nobody(result, blank(masks, True))).causes
    assert len(causes) == 4
    assert causes[1].startswith("cam02: silhouette over most of the image in 4 of 4 frames")


def test_nobody_and_a_camera_without_images(judge: Judge, result: Any, masks: Any) -> None:
    shown = {name: mask for name, mask in masks[0].items() if name != "cam04"}
    assert "cam04: no image" in judge(nobody(result, shown)).causes


def test_nobody_at_the_start_pose(judge: Judge, result: Any) -> None:
    (cause,) = judge(nobody(result), start_given=True).causes
    assert cause.startswith("the start pose does not fit the silhouettes")


def test_a_camera_that_contradicts_in_lost_frames_is_named(judge: Judge, result: Any) -> None:
    overlap = {"cam01": 0.9, "cam02": 0.2, "cam03": 0.9, "cam04": 0.85}
    lost = [result(index, LOST, overlap=overlap) for index in range(3)]
    found = judge(lost, start_given=True)
    assert found.tracked == 0 and found.lost == 3
    (cause,) = found.causes
    assert cause.startswith("cam02 contradicts the other cameras: overlap 0.20")


def test_nobody_where_the_silhouettes_meet_nowhere(judge: Judge, result: Any, masks: Any) -> None:
    corners = blank(masks, False)
    for number, mask in enumerate(corners.values()):
        # To the left, at the top in one view and at the bottom in the next.
        mask[slice(0, 12) if number % 2 else slice(180, 192), :12] = True
    (cause,) = judge(nobody(result, corners)).causes
    assert cause.startswith("the silhouettes meet nowhere in the room")


def test_nobody_although_something_stands_there(judge: Judge, result: Any) -> None:
    (cause,) = judge(nobody(result)).causes
    assert "is no whole person: too little of one is in view" in cause


def test_nobody_in_front_of_one_camera(result: Any, scene: Any, masks: Any) -> None:
    record = RunRecord(CameraRig(scene.rig.cameras[:1]))
    for index in range(3):
        shown = {"cam01": masks[index]["cam01"]}
        record.add(result(index, SEARCHING, shown=shown), scene.body)
    (cause,) = verdict_of(record, load_description("balan31")).causes
    assert cause.startswith("there is one camera: a person is found from two on")


def test_no_frame_at_all(judge: Judge) -> None:
    found = judge([])
    assert found.counts.startswith("0 frames") and found.look == "there was no frame"
    assert found.doubts == found.causes == ()


def test_memory_does_not_grow_with_the_frames(judge: Judge, result: Any, scene: Any) -> None:
    import tracemalloc

    record = RunRecord(scene.rig)
    frames = [result(index, warnings=(f"cam01: {index} px",)) for index in range(10)]
    for frame in frames * 3:
        record.add(frame, scene.body)
    tracemalloc.start()
    try:
        held = tracemalloc.get_traced_memory()[0]
        for frame in frames * 60:
            record.add(frame, scene.body)
        assert tracemalloc.get_traced_memory()[0] - held < 20_000
    finally:
        tracemalloc.stop()
    assert len(record.samples) <= 3


@pytest.mark.parametrize(
    ("overlap", "name"),
    [
        ({"cam01": 0.95, "cam02": 0.94, "cam03": 0.95}, ""),
        ({"cam01": 0.95, "cam02": 0.91, "cam03": 0.94}, "cam02"),
        ({"cam01": 0.95, "cam02": math.nan}, ""),
        ({"cam01": 0.95}, ""),
        ({"cam01": math.nan}, ""),
        ({}, ""),
    ],
)
def test_a_camera_fits_worst_where_it_clearly_does(overlap: dict[str, float], name: str) -> None:
    assert fits_worst(overlap) == name
