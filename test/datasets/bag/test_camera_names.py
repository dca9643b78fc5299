"""Names of a bag's cameras, from the topics of their images."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera import read_calibration
from markerless_tracker.datasets import open_recording
from markerless_tracker.datasets.bag.recording import _namespaces
from markerless_tracker.errors import DatasetError

from .conftest import FRAME, IMAGE, STEP_NS, both, frames_message, info, save, static


def test_cameras_of_one_name_are_told_apart_by_their_namespaces(
    make_recording, tmp_path: Path
) -> None:
    rig = read_calibration(make_recording() / "calibration.toml")
    frames = frames_message(
        static("map", "cam01_optical_frame", (1.0, 0.0, 0.0)),
        static("map", "cam02_optical_frame", (0.0, 0.0, 1.0)),
    )
    spaces = {"cam01": "/rig/front/camera", "cam02": "/rig/back/camera"}
    messages = [frames] + [
        (topic.replace(f"/{name}", space), kind, message)
        for name, space in spaces.items()
        for topic, kind, message in (info(name, rig), *both(0), *both(STEP_NS))
        if topic.startswith(f"/{name}/")
    ]
    recording = open_recording(save(tmp_path / "bag", messages))
    assert recording.rig.names == ("back_camera", "front_camera") and recording.frame_count == 2
    np.testing.assert_array_equal(recording.rig["front_camera"].matrix, rig["cam01"].matrix)
    (first, _) = recording.frames()
    np.testing.assert_array_equal(first.images["back_camera"], FRAME)


def test_names_that_are_joined_alike_stay_apart() -> None:
    topics = {"/a_b/c/image_raw": IMAGE, "/a/b_c/image_raw": IMAGE, "/x/b_c/image_raw": IMAGE,
              "/y/c/image_raw": IMAGE}  # fmt: skip
    named = _namespaces(topics)
    assert sorted(named.values()) == ["a/b_c", "a_b/c", "x/b_c", "y/c"]


def test_two_topics_for_one_calibrated_camera_are_refused(bag) -> None:
    twice = [
        (f"{space}{topic}", kind, message)
        for space in ("/a", "/b")
        for topic, kind, message in both(0)
    ]
    with pytest.raises(
        DatasetError, match="/a/cam01/image_raw and /b/cam01/image_raw may be images of cam01"
    ):
        open_recording(bag(twice))
