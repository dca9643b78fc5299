"""The body of an automatic start: sections, and lengths that were not measured."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import load_description, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.fitness.shape import fit_shape
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.start_fit import fitted_to_start
from markerless_tracker.tracking.search import make_searcher

SIZES = Sizes(load_description("person31"))
GENERIC = SIZES.of_stature(1.70)
RIG = ring_rig(4, (656, 490))
SEARCHER = make_searcher(GENERIC, rig=RIG, config=TrackerConfig(threads=1), threads=1)


def person():
    """A stout person of the generic body's stature with short arms and long calves."""
    lengths = dict(zip(SIZES.names, SIZES.of(GENERIC), strict=True))
    for name, factor in (("upper_arm", 0.9), ("forearm", 0.9), ("thigh", 0.95), ("calf", 1.1)):
        lengths[name] *= factor
    own = SIZES.body(np.array(list(lengths.values())))
    shape = own.cone_shape.copy()
    shape[:, :, :2] *= 1.15
    return replace(own, cone_shape=shape)


def pose_of(spread_rad):
    bent = {f"{s}_shoulder_x": spread_rad for s in "lr"} | {f"{s}_elbow": 0.9 for s in "lr"}
    pose = posture(GENERIC, bent | {f"{s}_knee": 0.5 for s in "lr"})
    pose[GENERIC.index("pelvis_tz")] = 0.95
    return pose


@pytest.fixture(scope="module")
def frames():
    """Contours and true poses of three frames of that person."""
    found = []
    for number, pose in enumerate([pose_of(0.5), pose_of(0.7), pose_of(0.9)]):
        seen = {
            name: Observation.from_mask(name, number, mask, np.zeros(mask.shape, np.uint8))
            for name, mask in body_masks(person(), pose, RIG).items()
        }
        found.append((SEARCHER.frame(seen, number, pose).contours, pose))
    return found


def off_m(body, pose, true):
    return float(np.linalg.norm(markers(body, pose) - markers(person(), true), axis=1).mean())


def test_known_lengths_and_poses_are_kept(frames) -> None:
    body, pose = fitted_to_start(SEARCHER, frames, None)
    # No marker shows the hands' length.
    others = {"hand": GENERIC.lengths_m["hand"]}
    assert body.lengths_m | others == GENERIC.lengths_m
    np.testing.assert_array_equal(pose, frames[-1][1])
    np.testing.assert_array_equal(body.cone_shape, fit_shape(GENERIC, frames).cone_shape)


@pytest.mark.parametrize("stature_m", [None, 1.70])
def test_lengths_approach_the_persons_and_the_last_pose_follows(frames, stature_m) -> None:
    """The start's poses explain the silhouettes with the generic body's lengths."""
    disturbed = [(contours, pose.copy()) for contours, pose in frames]
    for _, pose in disturbed:
        pose[GENERIC.joints] += 0.04
    body, pose = fitted_to_start(SEARCHER, disturbed, Unmeasured(SIZES, stature_m))
    before, after = (np.abs(np.log(SIZES.of(one) / SIZES.of(person()))) for one in (GENERIC, body))
    differ = before > 0.01
    assert after[differ].mean() < 0.9 * before[differ].mean()
    true = frames[-1][1]
    assert off_m(body, pose, true) < 0.6 * off_m(GENERIC, disturbed[-1][1], true)
    assert (pose >= SEARCHER.limits[0]).all() and (pose <= SEARCHER.limits[1]).all()


def test_a_given_stature_is_kept_more_closely(frames) -> None:
    heights = [
        sum(SIZES.of(fitted_to_start(SEARCHER, frames, Unmeasured(SIZES, given))[0]))
        for given in (1.60, None)
    ]
    assert heights[0] < heights[1] - 0.03
