"""Angles from markers against those reported by a body with the same markers."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.results.marker_angles import angle_errors, marker_angles
from markerless_tracker.results.score import score

BODY = load_body("person31", 1.75)


def track(*poses, names=MARKER_NAMES) -> MarkerTrack:
    points = np.array([markers(BODY, pose) for pose in poses])
    rows = [MARKER_NAMES.index(name) for name in names]
    return MarkerTrack(tuple(names), np.arange(len(poses)) * 16_666_667, points[:, rows])


@pytest.mark.parametrize("heading", [0.0, 2.5])
@pytest.mark.parametrize(
    "angles",
    [
        {},
        {"l_hip_y": 0.9, "r_hip_y": -0.3, "l_knee": 1.2, "r_knee": 0.3},
        {"l_hip_x": 0.4, "r_hip_x": -0.1, "l_elbow": 1.0, "r_elbow": 0.2},
        {"thorax_z": 0.4, "l_hip_y": 0.5, "l_hip_x": 0.2},
    ],
)
def test_markers_give_the_reported_angles(angles, heading) -> None:
    pose = posture(BODY, {**angles, "pelvis_rz": heading})
    reported = AngleReader(BODY).read(pose).degrees()
    found = marker_angles(track(pose))
    for name in (
        "knee_angle_l", "knee_angle_r", "elbow_flex_l", "elbow_flex_r", "hip_flexion_l",
        "hip_flexion_r", "hip_adduction_l", "hip_adduction_r", "lumbar_rotation",
    ):  # fmt: skip
        assert found[name][0] == pytest.approx(reported[name], abs=1e-5), name


def test_raised_arms_and_a_leaning_trunk() -> None:
    lean = posture(BODY, {"pelvis_ry": 0.3, "pelvis_rz": 1.0})
    found = marker_angles(track(lean))
    assert found["trunk_tilt"][0] == pytest.approx(-np.rad2deg(0.3))
    assert found["trunk_list"][0] == pytest.approx(0.0, abs=1e-9)
    right = posture(BODY, {"pelvis_rx": 0.2, "pelvis_rz": 1.0})
    assert marker_angles(track(right))["trunk_list"][0] == pytest.approx(np.rad2deg(0.2))
    raised = marker_angles(track(posture(BODY, {"l_shoulder_y": 1.5})))
    assert raised["arm_elevation_l"][0] == pytest.approx(np.rad2deg(1.5), abs=6.0)
    assert raised["arm_elevation_r"][0] < 10.0


def test_errors_are_root_mean_squares_over_frames() -> None:
    straight, bent = BODY.neutral, posture(BODY, {"l_knee": 0.2})
    errors = angle_errors(track(straight, bent), track(straight, straight))
    assert errors["knee_angle_l"] == pytest.approx(np.rad2deg(0.2) / np.sqrt(2.0))
    assert errors["knee_angle_r"] == pytest.approx(0.0, abs=1e-6)
    assert score(track(bent), track(straight)).as_dict()["angles"] == pytest.approx(
        angle_errors(track(bent), track(straight))
    )


def test_markers_that_are_missing_leave_their_angles_out() -> None:
    names = ("LHip", "RHip", "LKnee", "LAnkle", "Neck")
    some = track(BODY.neutral, names=names)
    found = marker_angles(some)
    assert set(found) == {
        "knee_angle_l", "hip_flexion_l", "hip_adduction_l", "trunk_tilt", "trunk_list",
    }  # fmt: skip
    points = some.positions_m.copy()
    points[0, names.index("LAnkle")] = np.nan
    holed = MarkerTrack(names, some.stamps_ns, points)
    assert np.isnan(marker_angles(holed)["knee_angle_l"]).all()
    assert "knee_angle_l" not in angle_errors(holed, some)
    assert marker_angles(track(BODY.neutral, names=("Head",))) == {}
