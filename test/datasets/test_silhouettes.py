"""Silhouettes made elsewhere in place of images."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import open_recording, write_image
from markerless_tracker.datasets.in_step import InStepRecording
from markerless_tracker.datasets.silhouettes import SilhouetteRecording
from markerless_tracker.errors import DatasetError
from markerless_tracker.observation import Observation


@pytest.fixture
def masks(tmp_path: Path) -> Path:
    """Six silhouettes of each camera: frame i has i + 1 columns of the person."""
    for name in ("cam01", "cam02"):
        for index in range(6):
            mask = np.zeros((48, 64, 3), np.uint8)
            mask[:, : index + 1, 2] = 128
            write_image(tmp_path / "masks" / name / f"{index:06d}.png", mask)
    return tmp_path / "masks"


def frame_of(seen: object) -> int:
    """Index of the frame whose silhouette an observation has."""
    assert isinstance(seen, Observation)
    return int(seen.mask[0].sum()) - 1


def test_a_late_camera_has_the_silhouettes_of_its_own_frames(make_recording, masks: Path) -> None:
    stored = open_recording(make_recording(frames=6, fps=10.0))
    late = SilhouetteRecording(InStepRecording(stored, {"cam02": 0.3}), masks)
    found = {
        frame.index: [frame_of(seen) for seen in frame.images.values()] for frame in late.frames()
    }
    assert found == {3: [3, 0], 4: [4, 1], 5: [5, 2]}
    for file in masks.glob("*/*.png"):
        file.unlink()
    none = SilhouetteRecording(InStepRecording(stored, {"cam01": 0.3}), masks)
    with pytest.raises(DatasetError, match="of any of the 3 frames .* such as cam01/000000.png"):
        list(none.frames())


def test_cameras_in_step_have_the_silhouettes_of_the_set(make_recording, masks: Path) -> None:
    recording = SilhouetteRecording(open_recording(make_recording(frames=6)), masks)
    for frame in recording.frames(start=1, every=2):
        assert [frame_of(seen) for seen in frame.images.values()] == [frame.index] * 2
