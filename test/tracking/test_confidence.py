"""How sure a pose is."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, markers, root_transform
from markerless_tracker.camera import project_camera
from markerless_tracker.fitness.contour import outline_rows
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.confidence import (
    ALONG_M,
    MEASURED_M,
    UNMEASURED_M,
    confidence_of,
    directions,
    disagreement_m,
    jacobians,
)
from markerless_tracker.tracking.limbs.rivals import rival_of
from markerless_tracker.tracking.search import Searcher


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(body="person31", motion="walk", size_px=(328, 245), seed=3)


def frame_of(scene, names):
    _, masks, pose = scene.frame(0)
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
        if name in names
    }
    body = scene.body
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    return pose, searcher.frame(seen, 0, pose).contours


def test_fewer_views_are_less_sure(scene) -> None:
    pose, four = frame_of(scene, scene.rig.names)
    _, one = frame_of(scene, scene.rig.names[:1])
    sure = confidence_of(scene.body, pose, four, measured=True)
    unsure = confidence_of(scene.body, pose, one, measured=True)
    assert sure is not None and unsure is not None
    assert unsure.markers_sd_m.mean() > 1.5 * sure.markers_sd_m.mean()
    # One camera does not see depth.
    camera = scene.rig.cameras[0]
    depth = np.abs(camera.T_cam_world[2, :3])
    pelvis = MARKER_NAMES.index("Pelvis")
    assert np.argmax(unsure.markers_sd_m[pelvis]) == np.argmax(depth)


def test_lengths_of_a_stature_are_less_sure(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    measured = confidence_of(scene.body, pose, contours, measured=True)
    generic = confidence_of(scene.body, pose, contours, measured=False)
    assert measured is not None and generic is not None
    assert (measured.markers_sd_m >= MEASURED_M).all()
    assert (generic.markers_sd_m >= UNMEASURED_M).all()
    assert (generic.pose_sd > measured.pose_sd).all()


def test_views_that_disagree_are_less_sure(scene) -> None:
    """One silhouette 6 px beside the others: about its part of the mean square over the views."""
    pose, contours = frame_of(scene, scene.rig.names)
    contours.collect(pose, 0.05)
    agreed = disagreement_m(contours, outline_rows(contours))
    sure = confidence_of(scene.body, pose, contours, measured=True)
    _, masks, _ = scene.frame(0)
    first, *others = scene.rig.names
    masks = {first: np.roll(masks[first], 6, axis=1), **{name: masks[name] for name in others}}
    seen = {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }
    searcher = Searcher(
        scene.rig, scene.body, TrackerConfig(threads=1), limits=scene.body.limits, threads=1
    )
    beside = searcher.frame(seen, 0, pose).contours
    beside.collect(pose, 0.10)
    camera = scene.rig[first]
    depth = float(camera.T_cam_world[2] @ root_transform(scene.body, pose)[:, 3])
    expected = 6.0 * depth / camera.matrix[0, 0] / np.sqrt(2 * len(scene.rig))
    off = disagreement_m(beside, outline_rows(beside))
    assert agreed < 0.003
    assert off == pytest.approx(expected, rel=0.25)
    unsure = confidence_of(scene.body, pose, beside, measured=True)
    assert sure is not None and unsure is not None
    assert unsure.markers_sd_m.mean() > 1.5 * sure.markers_sd_m.mean()


def test_a_limb_beside_its_silhouettes_is_unsure_and_the_others_are_not(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    sure = confidence_of(scene.body, pose, contours, measured=True)
    bent = pose.copy()
    bent[scene.body.index("l_elbow")] += 0.5
    unsure = confidence_of(scene.body, bent, contours, measured=True)
    assert sure is not None and unsure is not None
    gap_m = np.linalg.norm(markers(scene.body, bent) - markers(scene.body, pose), axis=1)
    wrist = MARKER_NAMES.index("LWrist")
    sd_m = np.linalg.norm(unsure.markers_sd_m, axis=1)
    assert gap_m[wrist] > 0.10
    assert sd_m[wrist] > max(0.05, 0.5 * gap_m[wrist])
    legs = [MARKER_NAMES.index(name) for name in ("LKnee", "LAnkle", "RKnee", "RAnkle")]
    assert (sd_m[legs] < 0.03).all()
    assert (np.linalg.norm(sure.markers_sd_m, axis=1)[wrist] < 0.03).all()
    arm = scene.body.subspaces["l_arm"]
    assert (unsure.pose_sd[arm] > sure.pose_sd[arm]).all()


def test_a_limb_that_unexplained_silhouette_may_belong_to_is_unsure(scene) -> None:
    """Its end by a half of the silhouette's size, the joints above it by less, others not."""
    pose, contours = frame_of(scene, scene.rig.names)
    sure = confidence_of(scene.body, pose, contours, measured=True)
    unsure = confidence_of(scene.body, pose, contours, measured=True, suspected_m={"l_arm": 0.2})
    assert sure is not None and unsure is not None
    before, after = sure.markers_sd_m.max(axis=1), unsure.markers_sd_m.max(axis=1)
    shoulder, elbow, wrist = (
        MARKER_NAMES.index(f"L{name}") for name in ("Shoulder", "Elbow", "Wrist")
    )
    assert after[wrist] == pytest.approx(np.hypot(before[wrist], 0.1), rel=0.01)
    assert 0.03 < after[elbow] < after[wrist]
    assert after[shoulder] < after[elbow]
    others = [i for i in range(len(before)) if i not in (shoulder, elbow, wrist)]
    np.testing.assert_array_equal(after[others], before[others])
    changed = unsure.pose_sd > sure.pose_sd
    assert set(np.flatnonzero(changed)) == set(scene.body.subspaces["l_arm"])


def test_a_limb_with_a_rival_is_unsure_along_the_way_to_it(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    body, elbow = scene.body, scene.body.index("l_elbow")
    other = pose.copy()
    other[elbow] += 1.0
    rival = rival_of(body, pose, other, 0.0)
    assert rival is not None
    sure = confidence_of(body, pose, contours, measured=True)
    unsure = confidence_of(body, pose, contours, measured=True, rivals={"l_arm": rival})
    assert sure is not None and unsure is not None
    added = unsure.markers_sd_m**2 - sure.markers_sd_m**2
    np.testing.assert_allclose(added, 0.5 * rival.moved_m**2, atol=1e-12)
    assert added.max() > 0.1**2
    added = unsure.pose_sd**2 - sure.pose_sd**2
    np.testing.assert_allclose(added, 0.5 * (np.arange(body.size) == elbow), atol=1e-12)


def test_a_body_with_fitted_lengths_is_less_sure_along_its_limbs(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    lengths = confidence_of(scene.body, pose, contours, measured=False)
    measured = confidence_of(scene.body, pose, contours, measured=True)
    assert lengths is not None and measured is not None
    along = directions(markers(scene.body, pose))
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0)
    added = lengths.markers_sd_m**2 - measured.markers_sd_m**2
    expected = UNMEASURED_M**2 - MEASURED_M**2 + (ALONG_M * along) ** 2
    np.testing.assert_allclose(added, expected, atol=1e-12)
    ankle, knee = MARKER_NAMES.index("LAnkle"), MARKER_NAMES.index("LKnee")
    shank = markers(scene.body, pose)[ankle] - markers(scene.body, pose)[knee]
    np.testing.assert_allclose(along[ankle], shank / np.linalg.norm(shank))


def test_markers_in_one_place_have_no_direction() -> None:
    np.testing.assert_array_equal(directions(np.ones((15, 3))), np.zeros((15, 3)))


def test_a_limb_on_undecided_pixels_is_less_sure(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    sure = confidence_of(scene.body, pose, contours, measured=True)
    _, masks, _ = scene.frame(0)
    joints = markers(scene.body, pose)
    knee, ankle = MARKER_NAMES.index("LKnee"), MARKER_NAMES.index("LAnkle")
    seen = {}
    for name, mask in masks.items():
        hidden = np.zeros(mask.shape, np.uint8)
        ends = np.round(project_camera(joints[[knee, ankle]], scene.rig[name])).astype(int)
        cv2.line(hidden, ends[0].tolist(), ends[1].tolist(), 1, 31)
        seen[name] = Observation.from_mask(
            name, 0, (mask > 0) & (hidden == 0), np.zeros(mask.shape, np.uint8), undecided=hidden
        )
    searcher = Searcher(
        scene.rig, scene.body, TrackerConfig(threads=1), limits=scene.body.limits, threads=1
    )
    hidden_leg = searcher.frame(seen, 0, pose).contours
    unsure = confidence_of(scene.body, pose, hidden_leg, measured=True)
    assert sure is not None and unsure is not None
    ratio = unsure.markers_sd_m.mean(axis=1) / sure.markers_sd_m.mean(axis=1)
    assert ratio[ankle] > 2.0
    assert ratio[MARKER_NAMES.index("LWrist")] < 1.5


def test_the_roots_covariance_is_one(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    sure = confidence_of(scene.body, pose, contours, measured=True)
    assert sure is not None
    assert np.linalg.eigvalsh(sure.root_covariance).min() > 0.0
    at = [scene.body.index(f"pelvis_t{axis}") for axis in "xyz"]
    np.testing.assert_allclose(
        np.sqrt(np.diag(sure.root_covariance)[:3]), sure.pose_sd[at], rtol=1e-6
    )


def test_no_silhouette_no_confidence(scene) -> None:
    pose, _ = frame_of(scene, scene.rig.names)
    body = scene.body
    nothing = {
        c.name: Observation.from_mask(
            c.name, 0, np.zeros(c.size_px[::-1], np.uint8), np.zeros(c.size_px[::-1], np.uint8)
        )
        for c in scene.rig
    }
    searcher = Searcher(scene.rig, body, TrackerConfig(threads=1), limits=body.limits, threads=1)
    contours = searcher.frame(nothing, 0, pose).contours
    assert confidence_of(body, pose, contours, measured=True) is None


def test_jacobians_against_finite_differences(scene) -> None:
    body, pose = scene.body, scene.pose(0)
    by_marker, by_root = jacobians(body, pose)
    rng = np.random.default_rng(0)
    change = 1e-3 * rng.standard_normal(body.size)
    after, before = markers(body, pose + change), markers(body, pose - change)
    np.testing.assert_allclose(2.0 * by_marker @ change, (after - before).ravel(), atol=2e-5)
    rotation = root_transform(body, pose + change)[:3, :3] @ root_transform(body, pose)[:3, :3].T
    small = np.array([rotation[2, 1], rotation[0, 2], rotation[1, 0]])
    np.testing.assert_allclose(by_root[3:] @ change, small, atol=2e-5)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e9])
def test_equations_that_cannot_be_solved_leave_it_unknown(scene, monkeypatch, value) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    sums = contours.equations(pose, 0.06)
    assert confidence_of(scene.body, pose, contours, measured=True) is not None
    broken = replace(sums, hessian=np.full_like(sums.hessian, value))
    monkeypatch.setattr(contours, "equations", lambda *_: broken)
    assert confidence_of(scene.body, pose, contours, measured=True) is None


def test_the_covariance_has_the_deviations_on_its_diagonal(scene) -> None:
    pose, contours = frame_of(scene, scene.rig.names)
    sure = confidence_of(scene.body, pose, contours, measured=True)
    assert sure is not None
    np.testing.assert_allclose(np.sqrt(np.diag(sure.covariance)), sure.pose_sd)
    np.testing.assert_allclose(sure.covariance, sure.covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(sure.covariance).min() > 0.0
    # Both parameters of the same limb are not independent.
    elbow, twist = scene.body.index("l_elbow"), scene.body.index("l_shoulder_z")
    assert sure.covariance[elbow, twist] != 0.0
    plain = replace(sure, pose_covariance=None)
    np.testing.assert_allclose(plain.covariance, np.diag(sure.pose_sd**2))


def test_a_straight_limbs_rotation_has_the_deviation_of_its_prior(scene) -> None:
    """And a bent one's a smaller one, by what the silhouettes show."""
    body = scene.body
    bent, contours = frame_of(scene, scene.rig.names)
    bent[[body.index("l_knee"), body.index("r_knee")]] = -0.8, 0.0
    sd = confidence_of(body, bent, contours, measured=True).pose_sd
    left, right = body.index("l_hip_z"), body.index("r_hip_z")
    assert sd[right] >= body.prior_sd[right]
    assert sd[left] < 0.8 * sd[right]
