"""Tests for `markerless_tracker.tracking.assess`."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.assess import Assessor
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.rivals import Rival
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.states import Phase, Track


@pytest.mark.parametrize(
    ("phase", "state", "lost"),
    [
        (Phase.SETTLING, TrackState.SEARCHING, ()),
        (Phase.TRACKING, TrackState.LOST, ("l_arm", "r_arm", "l_leg", "r_leg")),
    ],
)
def test_lost_limbs_are_those_of_the_tracked_person(phase, state, lost) -> None:
    """The limbs of an abandoned start are not those of the next person."""
    body, rig = load_body("person31", 1.75), ring_rig(4, (64, 48))
    empty = np.zeros((48, 64), np.uint8)
    seen = {c.name: Observation.from_mask(c.name, 0, empty, empty) for c in rig}
    assessor = Assessor(rig, body, TrackerConfig())
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    assessor.limbs.assess(body, pose, seen, np.ones(body.size))
    assert set(assessor.limbs.lost) == {"l_arm", "r_arm", "l_leg", "r_leg"}
    assessor.track = Track(phase)
    result = assessor.without_person(Seen(0, seen, seen, seen))
    assert result.state is state
    assert set(assessor.limbs.lost) == set(lost)


def test_a_suspected_limb_is_less_sure_in_the_result(
    frames, make_tracker, refined_settings, monkeypatch
) -> None:
    wrist, deviations = MARKER_NAMES.index("LWrist"), []
    for suspected_m in ({}, {"l_arm": 0.15}):
        monkeypatch.setattr(LimbWatch, "suspected_m", suspected_m)
        result = make_tracker(refined_settings).step(frames[0].observations, frames[0].stamp_ns)
        assert result.confidence is not None
        deviations.append(result.confidence.markers_sd_m[wrist].max())
    assert deviations[1] == pytest.approx(np.hypot(deviations[0], 0.075), rel=0.01)


def test_a_limb_with_a_rival_is_less_sure_in_the_result(
    frames, make_tracker, refined_settings, monkeypatch
) -> None:
    wrist, deviations = MARKER_NAMES.index("LWrist"), []
    moved_m = np.zeros((15, 3))
    moved_m[wrist, 1] = 0.4
    for rivals in ({}, {"l_arm": Rival(0.25, np.zeros(31), moved_m)}):
        monkeypatch.setattr(LimbWatch, "rivals", rivals)
        result = make_tracker(refined_settings).step(frames[0].observations, frames[0].stamp_ns)
        assert result.confidence is not None
        deviations.append(result.confidence.markers_sd_m[wrist])
    added = deviations[1] ** 2 - deviations[0] ** 2
    np.testing.assert_allclose(added, [0.0, 0.25 * 0.4**2, 0.0], atol=1e-12)
