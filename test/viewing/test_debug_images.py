"""One picture per frame and camera."""

import cv2
import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.datasets import FrameSet
from markerless_tracker.errors import DatasetError
from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.viewing.debug_images import DebugImages

SIZE = (80, 60)


@pytest.fixture(scope="module")
def body():
    return load_body("balan31", 1.7)


@pytest.fixture(scope="module")
def rig():
    return ring_rig(2, SIZE)


def frame(index: int) -> FrameSet:
    rng = np.random.default_rng(index)
    images = {f"cam0{c}": rng.integers(0, 200, (60, 80, 3), dtype=np.uint8) for c in (1, 2, 3)}
    return FrameSet(index, 100 + index, images)


def result(body, cameras=("cam01", "cam02"), pose=True) -> TrackResult:
    mask = np.zeros((60, 80), np.uint8)
    mask[20:40, 30:50] = 1
    standing = body.neutral.copy()
    standing[body.index("pelvis_tz")] = 0.9
    return TrackResult(
        stamp_ns=100,
        state=TrackState.TRACKING,
        pose=standing if pose else None,
        markers_m=None,
        fitness=1.0,
        iou={},
        evaluations=0,
        observations={name: Observation.from_mask(name, 100, mask, 200 * mask) for name in cameras},
    )


def test_pictures_of_the_cameras_that_gave_evidence(tmp_path, body, rig):
    debug = DebugImages(tmp_path / "deep" / "see")
    debug.write(frame(7), result(body), rig, body)
    debug.write(frame(12), result(body, cameras=("cam02",)), rig, body)
    found = sorted(p.relative_to(debug.folder).as_posix() for p in debug.folder.rglob("*.jpg"))
    assert found == ["cam01/000007.jpg", "cam02/000007.jpg", "cam02/000012.jpg"]


def test_input_evidence_and_body_side_by_side(tmp_path, body, rig):
    debug = DebugImages(tmp_path)
    images = frame(3)
    for index, pose in ((0, True), (1, False)):
        numbered = FrameSet(index, 0, images.images)
        debug.write(numbered, result(body, pose=pose), rig, body)
    with_body, without = (
        cv2.imread(str(tmp_path / "cam01" / f"00000{i}.jpg")).astype(int) for i in range(2)
    )
    assert with_body.shape == (60, 4 * 80, 3)
    panels = np.split(with_body, 4, axis=1)
    # JPEG blurs noise, so means are compared.
    assert abs(panels[0].mean() - images.images["cam01"].mean()) < 3.0
    assert panels[1][25:35, 35:45].mean() > 245
    assert panels[1][:10].mean() < 10
    assert abs(panels[2][25:35, 35:45].mean() - 200) < 10
    # Only the body distinguishes the last panels.
    assert np.abs(panels[3] - np.split(without, 4, axis=1)[3]).max() > 50
    assert np.abs(panels[0] - np.split(without, 4, axis=1)[0]).max() < 10


def test_background_and_labels_are_shown_with_a_segmenter(tmp_path, body, rig):
    images = frame(4)
    empty = np.full((60, 80, 3), 90, np.uint8)
    segmenter = Segmenter("cam01", learn_background([empty]))
    known = {"cam01": segmenter}
    DebugImages(tmp_path).write(images, result(body), rig, body, known.get)
    with_steps, without = (
        cv2.imread(str(tmp_path / name / "000004.jpg")) for name in ("cam01", "cam02")
    )
    assert with_steps.shape == (60, 6 * 80, 3) and without.shape == (60, 4 * 80, 3)
    panels = np.split(with_steps.astype(int), 6, axis=1)
    assert abs(panels[1] - 90).mean() < 2.0
    labels = segmenter.labels(images.images["cam01"])
    assert abs(panels[2].mean() - labels.mean()) < 5.0


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path, body, rig):
    taken = tmp_path / "file"
    taken.write_text("a file", encoding="utf-8")
    with pytest.raises(DatasetError, match="file: cannot be made: "):
        DebugImages(taken)
    debug = DebugImages(tmp_path / "see")
    (tmp_path / "see" / "cam01").write_text("a file", encoding="utf-8")
    with pytest.raises(DatasetError, match="cam01: cannot be made: "):
        debug.write(frame(0), result(body), rig, body)


def test_a_picture_that_cannot_be_written_is_an_error(tmp_path, body, rig):
    debug = DebugImages(tmp_path)
    (tmp_path / "cam01" / "000000.jpg").mkdir(parents=True)
    with pytest.raises(DatasetError, match="000000.jpg: cannot be written"):
        debug.write(frame(0), result(body), rig, body)
