"""A body is fitted to frames that agree with it, and to no others."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.estimate import START_FRAMES, BodyEstimate

FRAME_NS = 16_666_667


def silhouettes(frames, stamp_ns: int, change) -> dict[str, Observation]:
    """A frame's silhouettes (h, w), each changed."""
    out = {}
    for name, mask in frames[0].masks.items():
        mask = change(np.array(mask, dtype=np.uint8))
        out[name] = Observation.from_mask(name, stamp_ns, mask, np.zeros(mask.shape, np.uint8))
    return out


def speck(mask):
    """Something small where the person will stand."""
    rows, columns = np.nonzero(mask)
    v, u = int(rows.mean()), int(columns.mean())
    out = np.zeros_like(mask)
    out[v - 6 : v + 6, u - 12 : u + 12] = 1
    return out


def door(mask):
    """Something large beside the place where the person will stand."""
    out = np.zeros_like(mask)
    out[20:150, 20:90] = 1
    return out


def errors_mm(tracker, frames, first_ns: int) -> np.ndarray:
    out = []
    for index, frame in enumerate(frames):
        result = tracker.step(frame.observations, first_ns + index * FRAME_NS)
        gap = np.linalg.norm(result.markers_m - frame.markers_m, axis=1)
        out.append(1e3 * gap.mean())
    return np.array(out)


@pytest.mark.parametrize("stray", [speck, door])
@pytest.mark.parametrize("count", [1, 5])
def test_stray_frames_before_the_person_arrives_change_nothing(
    make_tracker, frames, refined_settings, stray, count
):
    clean, tracker = make_tracker(refined_settings), make_tracker(refined_settings)
    expected = errors_mm(clean, frames, count * FRAME_NS)
    for index in range(count):
        result = tracker.step(silhouettes(frames, index * FRAME_NS, stray), index * FRAME_NS)
        assert result.state is TrackState.SEARCHING and result.pose is None
    np.testing.assert_array_equal(errors_mm(tracker, frames, count * FRAME_NS), expected)
    np.testing.assert_array_equal(tracker.body.cone_shape, clean.body.cone_shape)


def test_a_start_beside_the_person_is_fitted_where_the_person_is(
    scene, make_tracker, frames, refined_settings
):
    start = scene.pose(0)
    start[scene.body.index("pelvis_tx")] += 0.25
    tracker = make_tracker(refined_settings, start_pose=start, search_again=False)
    assert errors_mm(tracker, frames, 0)[-1] < 40.0


def test_a_start_that_never_agrees_is_reported_once_and_given_up(
    make_tracker, frames, refined_settings
):
    tracker = make_tracker(refined_settings, evaluations=125)
    generic = tracker.body
    results = [
        tracker.step(silhouettes(frames, index * FRAME_NS, door), index * FRAME_NS)
        for index in range(START_FRAMES + 2)
    ]
    warned = [i for i, r in enumerate(results) if any("start pose" in w for w in r.warnings)]
    assert warned == [START_FRAMES]
    assert [r.state for r in results[:START_FRAMES]] == [TrackState.SEARCHING] * START_FRAMES
    assert results[START_FRAMES].state is TrackState.LOST
    assert tracker.body is generic
    tracker.reset()
    result = tracker.step(frames[0].observations, 0)
    assert result.state is TrackState.TRACKING and result.warnings == ()
    assert tracker.body is not generic


def test_sections_are_fitted_later_if_the_start_never_agreed(
    make_tracker, frames, refined_settings
):
    tracker = make_tracker(refined_settings, evaluations=125, search_again=False)
    generic = tracker.body
    for index in range(START_FRAMES):
        tracker.step(silhouettes(frames, index * FRAME_NS, speck), index * FRAME_NS)
    assert tracker.body is generic
    stamp_ns = START_FRAMES * FRAME_NS
    assert tracker.step(frames[0].observations, stamp_ns).state is TrackState.TRACKING
    assert tracker.body is not generic


def test_a_body_without_fit_is_tracked_from_the_first_frame_on(scene, frames, refined_settings):
    config = TrackerConfig.from_mapping(refined_settings)
    tracker = Tracker(scene.rig, scene.body, config, start_pose=scene.pose(0), shape_known=True)
    assert tracker.step(silhouettes(frames, 0, speck), 0).state is TrackState.LOST


def estimated(*, known: bool) -> BodyEstimate:
    """A person's body with sections of a thicker one; `known`: the person was measured."""
    sizes = Sizes(load_description("person31"))
    body = sizes.of_stature(1.8)
    person = None if known else Unmeasured(sizes, None)
    estimate = BodyEstimate(body, TrackerConfig(threads=1), person=person)
    estimate.take_found(replace(body, cone_shape=1.3 * body.cone_shape), settled=True)
    return estimate


def test_an_unmeasured_body_is_generic_again_once_the_person_was_turned_round() -> None:
    estimate = estimated(known=False)
    moved = estimate.restart_lengths()
    assert moved is not None and not moved.any()
    np.testing.assert_allclose(estimate.body.cone_shape, estimate.generic.cone_shape, atol=1e-9)
    np.testing.assert_allclose(estimate.body.cone_length, estimate.generic.cone_length, atol=1e-9)


def test_a_measured_body_stays_when_the_person_is_turned_round() -> None:
    estimate = estimated(known=True)
    before = estimate.body
    assert estimate.restart_lengths() is None
    assert estimate.body is before


def fitted_with(tracker, scene, frames, rig) -> np.ndarray:
    """Sections of a body whose first frame was seen by the tracker's cameras, then by a rig."""
    tracker.step(frames[0].observations, 0)
    tracker._searchers.rig = rig
    tracker._body.cameras_changed(tracker._searchers.near)
    return tracker.body.cone_shape


def test_sections_are_fitted_to_the_same_first_frame_again_when_cameras_changed(
    scene, make_tracker, frames, refined_settings
) -> None:
    wrong = scene.rig.shifted({"cam01": (6.0, 0.0)})
    expected = make_tracker(refined_settings)
    expected.step(frames[0].observations, 0)
    corrected = make_tracker(refined_settings, rig=wrong)
    shape = fitted_with(corrected, scene, frames, scene.rig)
    np.testing.assert_array_equal(shape, expected.body.cone_shape)
    assert (fitted_with(make_tracker(refined_settings), scene, frames, wrong) != shape).any()


def test_lengths_are_fitted_anew_when_cameras_changed() -> None:
    estimate = estimated(known=False)
    estimate._begin_lengths(estimate._person)
    begun, body = estimate._lengths, estimate.body
    estimate.cameras_changed(lambda body: pytest.fail("no frame is searched"))
    assert estimate._lengths is not begun and estimate.body is body


def test_fitted_lengths_stay_when_cameras_changed_after_a_given_start(
    scene, frames, refined_settings
) -> None:
    """Sections fitted to the first frame have the generic lengths."""
    config = TrackerConfig.from_mapping({**refined_settings, "body": "person31"})
    sizes = Sizes(load_description("person31"))
    estimate = BodyEstimate(sizes.of_stature(1.7), config, person=Unmeasured(sizes, 1.7))
    estimate._first = (frames[0].observations, 0, estimate.body.neutral)
    estimate.cameras_changed(lambda body: pytest.fail("no frame is searched"))
    assert estimate._lengths is not None


def test_a_known_shape_stays_when_cameras_changed(scene) -> None:
    config = TrackerConfig(threads=1)
    estimate = BodyEstimate(scene.body, config, shape_known=True)
    estimate.cameras_changed(lambda body: pytest.fail("no frame is searched"))
    assert estimate.body is scene.body
