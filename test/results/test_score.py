"""The figures of a score, worked by hand, and what cannot be compared."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.body import LIMB_MARKERS
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import rotation_from_rodrigues
from markerless_tracker.results.score import heading_frames, match_rows, score

# A person facing +x, left is +y.
POSE = {
    "LHip": (0.0, 0.1, 1.0),
    "RHip": (0.0, -0.1, 1.0),
    "Neck": (0.0, 0.0, 1.5),
    "LKnee": (0.0, 0.1, 0.5),
    "Head": (0.0, 0.0, 1.75),
}
FRAME_NS = 16_666_667


def track(stamps, *, pose=None, offset_mm=(0.0, 0.0, 0.0)) -> MarkerTrack:
    pose = pose or POSE
    positions = np.array(list(pose.values())) + np.array(offset_mm) / 1000.0
    return MarkerTrack(tuple(pose), np.array(stamps), np.repeat(positions[None], len(stamps), 0))


def edited(made: MarkerTrack, row: int, name: str, value) -> MarkerTrack:
    positions = made.positions_m.copy()
    positions[row, made.names.index(name)] = value
    return MarkerTrack(made.names, made.stamps_ns, positions)


def test_figures_by_hand() -> None:
    reference = track([0, FRAME_NS, 2 * FRAME_NS])
    result = track([0, FRAME_NS, 2 * FRAME_NS], offset_mm=(3.0, 0.0, 4.0))
    result = edited(result, 1, "LKnee", np.array(POSE["LKnee"]) + [0.065, 0.0, 0.0])
    figures = score(result, reference)
    # Six joints: the five and the pelvis made of the hips.
    assert figures.frame_mm.tolist() == pytest.approx([5.0, 15.0, 5.0])
    assert figures.mean_mm == pytest.approx(25 / 3)
    assert (figures.max_mm, figures.worst_joint_mm) == pytest.approx((15.0, 65.0))
    assert (figures.frames, figures.reference_frames) == (3, 3)
    assert figures.joints == pytest.approx(
        {"LHip": 5, "RHip": 5, "Neck": 5, "LKnee": 25, "Head": 5, "Pelvis": 5}
    )
    assert figures.limbs_mm == pytest.approx((5 + 25 + 5) / 3)
    assert figures.bias["Head"] == pytest.approx((3.0, 0.0, 4.0))
    assert figures.bias["LKnee"] == pytest.approx(((3 + 65 + 3) / 3, 0.0, 8 / 3))
    assert figures.joint_mm.shape == (3, 6)


def test_limbs_are_the_twelve() -> None:
    assert len(set(LIMB_MARKERS)) == 12 and {"LWrist", "RAnkle"} < set(LIMB_MARKERS)
    assert not {"Pelvis", "Neck", "Head"} & set(LIMB_MARKERS)


angles = st.floats(-3.0, 3.0)


@given(angles, st.tuples(angles, angles, angles))
def test_bias_does_not_depend_on_where_the_body_faces(heading, shift) -> None:
    matrix = rotation_from_rodrigues((0.0, 0.0, heading))
    pose = {name: matrix @ np.array(point) + np.array(shift) for name, point in POSE.items()}
    reference = track([0, FRAME_NS], pose=pose)
    result = track([0, FRAME_NS], pose=pose, offset_mm=matrix @ np.array([10.0, -20.0, 30.0]))
    assert score(result, reference).bias["Head"] == pytest.approx((10.0, -20.0, 30.0), abs=1e-6)


def test_rows_are_matched_by_time_not_by_number() -> None:
    reference = track([FRAME_NS * i for i in range(10)])
    result = track([FRAME_NS * i + 3_000_000 for i in (1, 4, 7)])
    figures = score(result, reference)
    assert figures.frames == 3 and figures.reference_frames == 10
    assert figures.stamps_ns.tolist() == [FRAME_NS * i for i in (1, 4, 7)]


def test_rows_more_than_half_a_frame_apart_are_not_compared() -> None:
    reference = track([0, 100, 200])
    result, kept = match_rows(track([-51, 149, 260]), reference)
    assert (result.tolist(), kept.tolist()) == ([1], [1])


def test_no_reference_row_is_used_twice() -> None:
    rows, reference_rows = match_rows(track([90, 110, 130]), track([0, 100, 200]))
    assert rows.tolist() == [0] and reference_rows.tolist() == [1]


@given(
    st.lists(st.integers(0, 10**6), unique=True, min_size=1, max_size=20).map(sorted),
    st.lists(st.integers(0, 10**6), unique=True, min_size=1, max_size=20).map(sorted),
)
def test_matches_are_one_to_one_and_in_order(a, b) -> None:
    rows, reference_rows = match_rows(track(a), track(b))
    assert (np.diff(rows) > 0).all() and (np.diff(reference_rows) > 0).all()
    same, other = match_rows(track(a), track(a))
    assert same.tolist() == other.tolist() == list(range(len(a)))


def test_blank_rows_and_missing_markers_are_left_out() -> None:
    stamps = [0, FRAME_NS, 2 * FRAME_NS]
    result = track(stamps, offset_mm=(2.0, 0.0, 0.0))
    for name in POSE:
        result = edited(result, 1, name, np.nan)
    reference = edited(track(stamps), 2, "Head", np.nan)
    figures = score(result, reference)
    assert figures.frames == 2 and figures.reference_frames == 3
    assert figures.mean_mm == pytest.approx(2.0)
    assert np.isnan(figures.joint_mm[1, figures.names.index("Head")])


def test_a_joint_never_compared_is_null_in_json() -> None:
    reference = edited(track([0]), 0, "Head", np.nan)
    figures = score(track([0]), reference)
    figures_back = json.loads(json.dumps(figures.as_dict(), allow_nan=False))
    assert figures_back["joints"]["Head"] is None and "Head" not in figures_back["bias"]
    assert list(figures_back) == [
        "mean_mm",
        "max_mm",
        "worst_joint_mm",
        "frames",
        "reference_frames",
        "frame_mm",
        "joints",
        "limbs_mm",
        "bias",
        "offsets_off_mm",
        "inside_sd",
        "angles",
    ]
    assert figures_back["offsets_off_mm"] == {"limbs": 0.0, "all": 0.0}
    assert figures_back["inside_sd"] is None


def test_without_limbs_or_heading() -> None:
    figures = score(track([0], pose={"Head": (0, 0, 1)}), track([0], pose={"Head": (0, 0, 2)}))
    assert figures.mean_mm == pytest.approx(1000.0)
    assert math.isnan(figures.limbs_mm) and figures.bias == {}
    assert figures.as_dict()["offsets_off_mm"] == {"limbs": None, "all": None}


def test_heading_comes_from_hips_and_shoulders() -> None:
    hips = {"LHip": (0.0, 0.1, 1.0), "RHip": (0.0, -0.1, 1.1)}
    shoulders = {"LShoulder": (0.1, 0.2, 1.5), "RShoulder": (0.1, -0.2, 1.4)}
    for pose in (hips, shoulders, hips | shoulders):
        np.testing.assert_allclose(heading_frames(track([0], pose=pose))[0], np.eye(3), atol=1e-12)
    above = {"LHip": (0.0, 0.0, 1.2), "RHip": (0.0, 0.0, 1.0)}
    for pose in (above, {"LHip": (0.0, 0.1, 1.0), "Neck": (0.0, 0.0, 1.5)}):
        assert np.isnan(heading_frames(track([0], pose=pose))).all()


def test_what_cannot_be_compared_is_reported() -> None:
    with pytest.raises(DatasetError, match="no common marker.*Nose.*Head"):
        score(track([0], pose={"Nose": (0, 0, 0)}), track([0]))
    with pytest.raises(DatasetError, match=r"no common frame.*5\.000 to 5\.017 s.*0\.000 s"):
        score(track([5 * 10**9, 5 * 10**9 + FRAME_NS]), track([0]))
    blank = track([0, FRAME_NS])
    for name in POSE:
        for row in (0, 1):
            blank = edited(blank, row, name, np.nan)
    with pytest.raises(DatasetError, match="no tracked frame"):
        score(blank, track([0, FRAME_NS]))
    with pytest.raises(DatasetError, match="no tracked frame"):
        score(track([]), track([0]))


def test_a_reference_against_itself_is_exact(balance_real) -> None:
    from markerless_tracker.datasets import read_trc

    reference = read_trc(balance_real / "ground_truth.trc")
    figures = score(reference, reference)
    assert figures.mean_mm == figures.worst_joint_mm == 0.0 and figures.frames == 100
    assert "Pelvis" in figures.joints
