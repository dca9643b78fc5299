"""The predicted body decides undecided pixels near it."""

import cv2
import numpy as np
import pytest

from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.records import Observation
from markerless_tracker.tracking.evidence.undecided import NEAR_PX, decide


@pytest.fixture
def covered(body, camera, pose):
    return body_masks(body, pose, [camera])[camera.name]


def observe(mask, undecided, **region) -> Observation:
    edges = np.full(mask.shape, 9, dtype=np.uint8)
    return Observation.from_mask("cam01", 5, mask, edges, undecided=undecided, **region)


def near(covered):
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * NEAR_PX + 1, 2 * NEAR_PX + 1))
    return cv2.dilate(covered.astype(np.uint8), disc) > 0


def test_near_the_body_it_is_person_elsewhere_it_stays(body, camera, pose, covered) -> None:
    nothing = np.zeros_like(covered)
    seen = decide({"cam01": observe(nothing, ~nothing)}, {"cam01": camera}, body, pose)["cam01"]
    np.testing.assert_array_equal(seen.mask, near(covered))
    np.testing.assert_array_equal(seen.undecided, ~near(covered))
    assert (seen.camera, seen.stamp_ns, seen.size_px) == ("cam01", 5, (240, 180))
    assert (seen.edges == 9).all()


def test_what_is_decided_does_not_change(body, camera, pose, covered) -> None:
    """Person away from the body stays person, background under it stays background."""
    person, undecided = np.zeros_like(covered), np.zeros_like(covered)
    person[:20, :20] = True
    undecided[90:] = True
    seen = decide({"cam01": observe(person, undecided)}, {"cam01": camera}, body, pose)["cam01"]
    np.testing.assert_array_equal(seen.mask, person | (undecided & near(covered)))
    np.testing.assert_array_equal(seen.not_background, person | undecided)


def test_a_region_is_decided_as_the_frame(body, camera, pose, covered) -> None:
    region = np.s_[30:170, 80:181]
    nothing = np.zeros((140, 101), bool)
    cut = observe(nothing, ~nothing, size_px=(240, 180), offset_px=(80, 30))
    seen = decide({"cam01": cut}, {"cam01": camera}, body, pose)["cam01"]
    np.testing.assert_array_equal(seen.mask, near(covered[region]))


def test_two_classes_are_passed_on(body, camera, pose, covered) -> None:
    seen = observe(covered, None)
    assert decide({"cam01": seen}, {"cam01": camera}, body, pose) == {"cam01": seen}
