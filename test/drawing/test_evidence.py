"""Input, mask, edges and body side by side."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.drawing import draw_evidence, draw_overlay
from markerless_tracker.drawing.evidence import UNDECIDED_BGR
from markerless_tracker.errors import ImageError
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

BODY = load_body("balan31")
CAMERA = ring_rig(1, (120, 90)).cameras[0]
POSE = BODY.neutral.copy()
POSE[BODY.index("pelvis_tz")] = 0.85
IMAGE = np.random.default_rng(0).integers(0, 256, (90, 120, 3), dtype=np.uint8)


def region():
    """A region 30 x 20 px at (40, 50)."""
    rng = np.random.default_rng(1)
    mask, edges = rng.uniform(size=(20, 30)) < 0.5, rng.integers(0, 256, (20, 30), dtype=np.uint8)
    return mask, edges, Observation.from_mask(
        "cam01", 0, mask, edges, size_px=(120, 90), offset_px=(40, 50)
    )  # fmt: skip


def test_four_panels() -> None:
    mask, edges, observation = region()
    picture = draw_evidence(IMAGE, observation, CAMERA, BODY, POSE)
    assert picture.shape == (90, 480, 3) and picture.dtype == np.uint8
    plain, shown_mask, shown_edges, over = np.split(picture, 4, axis=1)
    np.testing.assert_array_equal(plain, IMAGE)
    np.testing.assert_array_equal(shown_mask[50:70, 40:70, 0], mask * 255)
    np.testing.assert_array_equal(shown_edges[50:70, 40:70, 2], edges)
    for shown in (shown_mask, shown_edges):
        assert (shown[:50] == 64).all() and (shown[:, :40] == 64).all()
    full = np.zeros((90, 120), dtype=np.bool_)
    full[50:70, 40:70] = mask
    np.testing.assert_array_equal(over, draw_overlay(IMAGE, CAMERA, BODY, POSE, mask=full))


def test_undecided_pixels_have_their_own_colour() -> None:
    mask, edges, plain = region()
    undecided = ~mask & (np.random.default_rng(2).uniform(size=mask.shape) < 0.5)
    picture = draw_evidence(IMAGE, plain.with_masks(mask, undecided), CAMERA, BODY, POSE)
    shown = picture[50:70, 160:190]
    assert undecided.any() and (shown[undecided] == UNDECIDED_BGR).all()
    assert (shown[mask] == 255).all() and (shown[~mask & ~undecided] == 0).all()
    # Nothing else changes.
    picture[50:70, 160:190][undecided] = 0
    np.testing.assert_array_equal(picture, draw_evidence(IMAGE, plain, CAMERA, BODY, POSE))


def test_background_and_labels_come_after_the_input() -> None:
    background, labels = IMAGE[::-1], np.full((90, 120), 127, np.uint8)
    observation = region()[2]
    four = draw_evidence(IMAGE, observation, CAMERA)
    six = draw_evidence(IMAGE, observation, CAMERA, background=background, labels=labels)
    assert six.shape == (90, 720, 3)
    np.testing.assert_array_equal(six[:, :120], four[:, :120])
    np.testing.assert_array_equal(six[:, 120:240], background)
    assert (six[:, 240:360] == 127).all()
    np.testing.assert_array_equal(six[:, 360:], four[:, 120:])


def test_without_a_pose_the_last_panel_is_the_input() -> None:
    picture = draw_evidence(IMAGE[..., 0], region()[2], CAMERA, BODY, None)
    np.testing.assert_array_equal(picture[:, 360:], np.repeat(IMAGE[..., :1], 3, axis=2))


def test_an_observation_of_another_size() -> None:
    other = Observation.from_mask("cam01", 0, np.ones((9, 9)), np.zeros((9, 9), np.uint8))
    with pytest.raises(
        ImageError, match="cam01: observation of a frame of 9x9 px, expected 120x90"
    ):
        draw_evidence(IMAGE, other, CAMERA)
