"""Views and start poses that do not fit: one clear line, and the tracker stays as it was."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.errors import BodyModelError, CalibrationError, ImageError
from markerless_tracker.records import Observation, TrackState
from markerless_tracker.tracking import Tracker, TrackerConfig


class TestErrors:
    """Bad views raise one line naming the camera, and the track goes on as if they never came."""

    @pytest.fixture
    def refused(self, make_tracker, frames, swarm_settings):
        def check(views, error, message):
            tracker = make_tracker(swarm_settings)
            with pytest.raises(error, match=message) as caught:
                tracker.step(views, 5)
            assert "\n" not in str(caught.value)
            after = tracker.step(frames[0].observations, 0)
            fresh = make_tracker(swarm_settings).step(frames[0].observations, 0)
            assert after.pose.tobytes() == fresh.pose.tobytes()

        return check

    def test_no_view(self, refused):
        refused({}, ImageError, "no view came, expected some of cam01, cam02, cam03, cam04")

    def test_an_unknown_camera(self, refused, frames):
        views = {**frames[0].images, "cam09": frames[0].images["cam01"]}
        refused(views, CalibrationError, "no camera 'cam09', the rig has cam01, cam02")

    def test_an_image_of_another_size(self, refused, frames):
        views = {**frames[0].images, "cam02": np.zeros((100, 100, 3), np.uint8)}
        refused(views, ImageError, "cam02: got an image of 100x100 px, expected 256x192 px")

    def test_an_image_that_is_none(self, refused, frames):
        refused({**frames[0].images, "cam02": None}, ImageError, "cam02: got NoneType")
        floats = frames[0].images["cam02"].astype(float)
        refused({**frames[0].images, "cam02": floats}, ImageError, "cam02: got an image of float64")

    def test_an_observation_of_another_size(self, refused, frames):
        small = np.zeros((96, 128), np.uint8)
        views = {**frames[0].images, "cam03": Observation.from_mask("cam03", 0, small, small)}
        refused(views, ImageError, "cam03: observation of a 128x96 px frame.* 256x192 px")

    def test_an_observation_of_another_size_during_the_search(self, scene, frames, swarm_settings):
        """Nobody would be found in it."""
        config = TrackerConfig.from_mapping(swarm_settings)
        tracker = Tracker(scene.rig, scene.body, config)
        large = np.zeros((384, 512), np.uint8)
        views = {**frames[0].observations, "cam03": Observation.from_mask("cam03", 0, large, large)}
        with pytest.raises(ImageError, match=r"cam03: observation of a 512x384 px .* 256x192 px"):
            tracker.step(views, 0)

    def test_an_image_without_a_background(self, scene, frames, backgrounds, swarm_settings):
        tracker = Tracker(
            scene.rig,
            scene.body,
            TrackerConfig.from_mapping(swarm_settings),
            start_pose=scene.pose(0),
            backgrounds={name: b for name, b in backgrounds.items() if name != "cam02"},
        )
        with pytest.raises(ImageError, match="cam02: an image came, but no background"):
            tracker.step(frames[0].images, 0)
        views = {**frames[0].images, "cam02": frames[0].observations["cam02"]}
        assert tracker.step(views, 0).state is TrackState.TRACKING

    def test_a_background_of_another_size(self, scene, backgrounds, swarm_settings):
        with pytest.raises(ImageError, match="cam01: background of 256x192 px.*says 128x96"):
            Tracker(
                scene.rig.scaled(0.5),
                scene.body,
                TrackerConfig.from_mapping(swarm_settings),
                start_pose=scene.pose(0),
                backgrounds=backgrounds,
            )

    @pytest.mark.parametrize(
        "start", [np.zeros(30), np.zeros((1, 31)), np.full(31, np.nan), np.full(31, np.inf)]
    )
    @pytest.mark.parametrize("measured", [False, True])
    def test_a_start_pose_that_is_none(self, scene, start, measured):
        body = replace(scene.body, measured=measured)
        with pytest.raises(BodyModelError, match="start pose has shape .* balan31 expects 31"):
            Tracker(scene.rig, body, TrackerConfig(), start_pose=start)


def test_a_start_outside_the_limits_is_refused_by_name(scene, swarm_settings) -> None:
    pose = scene.pose(0).copy()
    pose[scene.body.index("l_knee")] = 1.0
    with pytest.raises(BodyModelError, match=r"start pose: l_knee is 1, its limits are -2\.7"):
        Tracker(scene.rig, scene.body, TrackerConfig.from_mapping(swarm_settings), start_pose=pose)
