"""A body that was fitted to one posture, fitted to a whole recording."""

from types import SimpleNamespace

import numpy as np

from markerless_tracker.body import load_description, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.whole import MOST, MOST_KEPT, WholeRecording

SIZES = Sizes(load_description("person31"))
GENERIC = SIZES.of_stature(1.70)
RIG = ring_rig(4, (656, 490))
CONFIG = TrackerConfig.from_mapping({"threads": 1})
PERSON = Unmeasured(SIZES, None)


def true_body():
    """Longer thighs and shorter upper arms than most."""
    lengths = SIZES.of(SIZES.of_stature(1.76))
    lengths[SIZES.names.index("thigh")] *= 1.06
    lengths[SIZES.names.index("upper_arm")] *= 0.94
    return SIZES.body(lengths)


def pose_number(number):
    """Poses (p,) of a person standing, kneeling down and raising the arms."""
    bend, lift = 0.45 * number, 0.5 * number
    angles = {f"{s}_{n}": a for s in "lr" for n, a in (
        ("hip_y", bend), ("knee", 2.0 * bend), ("shoulder_x", 0.5 + lift), ("elbow", 0.4 + lift),
    )}  # fmt: skip
    pose = posture(GENERIC, angles)
    pose[GENERIC.index("pelvis_tz")] = 0.95 - 0.1 * number
    return pose


def result(pose, observations=None, state=TrackState.TRACKING, stamp_ns=0):
    return SimpleNamespace(
        state=state, pose=pose, observations=observations or {}, stamp_ns=stamp_ns
    )


def seen(true, pose):
    out = {}
    for camera in RIG:
        mask = silhouette(true, pose, camera).astype(np.uint8)
        out[camera.name] = Observation.from_mask(camera.name, 0, mask, np.zeros_like(mask))
    return out


def test_joints_approach_the_persons() -> None:
    true, whole = true_body(), WholeRecording()
    rng = np.random.default_rng(1)
    for number in range(3):
        pose = pose_number(number)
        about = pose.copy()
        about[GENERIC.joints] += rng.normal(0.0, 0.04, GENERIC.joints.size)
        whole.add(result(np.clip(about, *GENERIC.limits), seen(true, pose)))
    fitted = whole.fitted(RIG, GENERIC, CONFIG, PERSON)
    lengths = [np.abs(np.log(SIZES.of(b) / SIZES.of(true))).mean() for b in (GENERIC, fitted)]
    assert lengths[1] < 0.7 * lengths[0]
    neutral = [markers(b, GENERIC.neutral) for b in (true, GENERIC, fitted)]
    gaps = [np.linalg.norm(one - neutral[0], axis=1).mean() for one in neutral[1:]]
    assert gaps[1] < 0.7 * gaps[0]


def test_poses_as_different_as_possible_are_chosen() -> None:
    whole = WholeRecording()
    for number in range(3 * MOST):
        bent = GENERIC.neutral.copy()
        bent[GENERIC.index("l_knee")] = -0.2 * (number % MOST)
        # Where the person stands is no variety.
        bent[GENERIC.index("pelvis_tx")] = number
        whole.add(result(bent))
    chosen = whole.chosen(GENERIC)
    assert chosen == sorted(chosen)
    assert sorted(number % MOST for number in chosen) == list(range(MOST))


def test_long_runs_are_kept_evenly_and_lost_frames_not() -> None:
    whole = WholeRecording()
    for number in range(5 * MOST_KEPT):
        whole.add(result(GENERIC.neutral, stamp_ns=number))
        whole.add(result(GENERIC.neutral, state=TrackState.LOST, stamp_ns=-1))
    stamps = [frame.stamp_ns for frame in whole._kept.items]
    assert len(stamps) < MOST_KEPT and len(set(np.diff(stamps))) == 1 and min(stamps) == 0
    assert max(stamps) > 4 * MOST_KEPT


def test_nothing_tracked_changes_nothing() -> None:
    whole = WholeRecording()
    assert whole.chosen(GENERIC) == []
    assert whole.fitted(RIG, GENERIC, CONFIG, PERSON) is GENERIC
