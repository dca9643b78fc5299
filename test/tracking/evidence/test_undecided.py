"""The predicted body decides undecided pixels near it."""

import cv2
import numpy as np
import pytest

from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.undecided import decide


@pytest.fixture
def covered(body, camera, pose):
    return body_masks(body, pose, [camera])[camera.name]


def observe(mask, undecided, **region) -> Observation:
    edges = np.full(mask.shape, 9, dtype=np.uint8)
    return Observation.from_mask("cam01", 5, mask, edges, undecided=undecided, **region)


def near(covered):
    """What the body covers, and the next pixel."""
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return cv2.dilate(covered.astype(np.uint8), cross) > 0


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


@pytest.fixture(scope="module")
def standing():
    """A scene, its pose, and observations that show the body and nothing else."""
    scene = SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3)
    pose = scene.frame(0)[2]
    return scene, pose, body_masks(scene.body, pose, scene.rig.cameras)


def decided(standing, name, undecided, dark=None):
    """What is person in one view, where pixels are undecided there, and `dark` in the others."""
    scene, pose, masks = standing
    cameras = {camera.name: camera for camera in scene.rig}
    seen = {}
    for other, mask in masks.items():
        left = undecided if other == name else (dark or {}).get(other, np.zeros_like(mask))
        nothing = np.zeros(mask.shape, np.uint8)
        left = left & ~mask
        seen[other] = Observation.from_mask(other, 0, mask, nothing, undecided=left)
    return decide(seen, cameras, scene.body, pose)[name].mask & undecided & ~grown(masks[name], 1)


def grown(mask, px):
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * px + 1,) * 2, np.uint8)) > 0


def test_a_patch_that_ends_beside_the_body_is_person_one_that_goes_on_is_not(standing) -> None:
    scene, _, masks = standing
    name = scene.rig.names[0]
    mask = masks[name]
    # Beside the head, whose floor points are far away.
    top = int(np.flatnonzero(mask.any(axis=1))[0]) + 3
    right = int(np.flatnonzero(mask[top])[-1])
    for length, person in ((4, True), (60, False)):
        patch = np.zeros_like(mask)
        patch[top : top + 3, right : right + length] = True
        assert decided(standing, name, patch).any() == person


def test_a_long_patch_is_person_where_others_see_its_floor_lit(standing) -> None:
    """Beside the shin, going on to the side; in the other views the floor is lit or darkened."""
    scene, pose, masks = standing
    name = scene.rig.names[0]
    mask = masks[name]
    low = int(np.flatnonzero(mask.any(axis=1))[-1]) - 15
    right = int(np.flatnonzero(mask[low])[-1])
    patch = np.zeros_like(mask)
    patch[low : low + 3, right : right + 60] = True
    person = decided(standing, name, patch)
    assert person.any() and not person[:, right + 30 :].any()
    dark = {other: np.ones_like(shown) for other, shown in masks.items()}
    assert not decided(standing, name, patch, dark).any()
