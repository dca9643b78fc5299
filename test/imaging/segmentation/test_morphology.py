import cv2
import numpy as np
from hypothesis import given
from hypothesis.extra import numpy as hnp

from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.imaging.segmentation.blobs import clear_small, fill_small
from markerless_tracker.imaging.segmentation.morphology import (
    SPLIT_RADIUS_PX,
    add_mixed_patches,
    clean_mask,
    closing_px,
    fill_specks,
    opening_radius_px,
    shadow_patches,
    split_undecided,
)


def body() -> np.ndarray:
    mask = np.zeros((120, 160), np.uint8)
    mask[20:100, 60:100] = 255
    return mask


def test_specks_are_removed_and_the_body_stays() -> None:
    mask = body()
    mask[5, 5] = mask[110:112, 150] = 255
    clean_mask(mask, ImagingSettings())
    expected = body()
    assert (mask != expected).sum() <= 4  # the cross-shaped opening may round corners
    assert mask[5, 5] == 0


def test_small_holes_fill_and_large_ones_stay() -> None:
    mask = body()
    mask[40:42, 70:72] = 0
    mask[60:80, 70:90] = 0
    fill_small(mask, 10)
    assert mask[40, 70] == 255 and mask[70, 80] == 0


def test_a_gap_that_is_open_to_the_outside_is_no_hole() -> None:
    mask = body()
    mask[50, 60:64] = 0
    fill_small(mask, 10)
    assert (mask[50, 60:64] == 0).all()


def test_the_closing_is_smaller_in_small_images() -> None:
    options = ImagingSettings.from_mapping({"mask.close_px": 5})
    sides = [
        closing_px(options, w * h) for w, h in ((1920, 1080), (640, 480), (320, 240), (64, 48))
    ]
    assert sides == [5, 5, 3, 1]
    assert closing_px(ImagingSettings.from_mapping({"mask.close_px": 0}), 640 * 480) == 1


def test_blobs_are_dropped_by_area() -> None:
    mask = np.zeros((50, 50), np.uint8)
    mask[2:5, 2:5] = mask[20:30, 20:30] = 255
    clear_small(mask, 10, connectivity=8)
    assert mask[3, 3] == 0 and (mask[20:30, 20:30] == 255).all()


def test_an_empty_and_a_full_mask_stay() -> None:
    for value in (0, 255):
        mask = np.full((30, 40), value, np.uint8)
        assert (clean_mask(mask.copy(), ImagingSettings()) == mask).all()


def test_repairs_do_not_grow_or_shrink_a_round_body() -> None:
    mask = np.zeros((200, 200), np.uint8)
    cv2.ellipse(mask, (100, 100), (40, 70), 20, 0, 360, 255, -1)
    area = int((mask > 0).sum())
    clean_mask(mask, ImagingSettings())
    assert abs(int((mask > 0).sum()) - area) < 0.005 * area


def patches(labels: np.ndarray, least_px: float, *, opened: bool) -> np.ndarray:
    """(h, w) bool."""
    shadow = np.empty_like(labels)
    assert not shadow_patches(labels, shadow, least_px, opened=opened)
    return shadow > 0


def test_small_patches_are_no_shadows() -> None:
    labels = body()
    labels[30:34, 70:74] = 127
    labels[100:110, 60:140] = 127
    large = np.zeros(labels.shape, bool)
    large[100:110, 60:140] = True
    np.testing.assert_array_equal(patches(labels, 50, opened=False), large)
    np.testing.assert_array_equal(patches(labels, 0, opened=False), labels == 127)


def test_threads_of_a_patch_are_opened_away() -> None:
    labels = body()
    labels[100:110, 60:140] = 127
    labels[60:100, 80] = 127  # one pixel wide, attached to the large patch
    opened = patches(labels, 50, opened=True)
    assert not opened[70, 80] and opened[105, 100]
    assert patches(labels, 50, opened=False)[70, 80]


def test_weak_pixels_between_foreground_pixels_are_foreground() -> None:
    labels = np.zeros((40, 60), np.uint8)
    labels[10:30, 10:30] = 64
    labels[10:30:2, 10:30:2] = 255  # every second pixel of clothes like the background
    labels[20, 40] = 64  # alone
    fill_specks(labels)
    assert (labels[11:28, 11:28] == 255).all()
    assert labels[20, 40] == 64 and not labels[:, 31:40].any()


def test_shadow_between_foreground_pixels_stays() -> None:
    labels = np.full((40, 60), 127, np.uint8)
    labels[::2, ::2] = 255
    before = labels.copy()
    fill_specks(labels)
    np.testing.assert_array_equal(labels, before)


def test_weak_pixels_of_a_wide_mixture_are_a_patch() -> None:
    labels = np.zeros((60, 60), np.uint8)
    labels[10:40, 10:40] = 64
    labels[10:40:3, 10:40] = 255  # stripes, between which an opening leaves nothing
    assert not patches(labels, 0, opened=True).any()
    shadow = np.zeros_like(labels)
    add_mixed_patches(labels, shadow)
    np.testing.assert_array_equal(shadow[12:38, 10:40] > 0, labels[12:38, 10:40] == 64)
    assert not shadow[labels == 0].any()


def test_a_seam_around_the_body_is_no_mixture() -> None:
    labels = np.where(cv2.dilate(body(), np.ones((3, 3), np.uint8)) > 0, 64, 0).astype(np.uint8)
    labels[body() > 0] = 255
    shadow = np.zeros_like(labels)
    add_mixed_patches(labels, shadow)
    assert not shadow.any()


def mixed(labels: np.ndarray) -> np.ndarray:
    """(h, w): labels after `fill_specks`, plus 1 in shadow patches, mixed ones included."""
    labels, shadow = labels.copy(), np.empty_like(labels)
    fill_specks(labels)
    assert not shadow_patches(labels, shadow, 0, opened=True)
    add_mixed_patches(labels, shadow)
    return labels.astype(int) + (shadow > 0)


def test_patches_depend_on_labels_within_the_stated_radius() -> None:
    """So a region of an image gives what the whole image gives."""
    radius = opening_radius_px(ImagingSettings(), grey=False)
    rng, classes = np.random.default_rng(5), np.array([0, 64, 127, 255], np.uint8)
    inside, crop = slice(35, 55), slice(35 - radius, 55 + radius)
    for _ in range(60):
        blocks = rng.choice(classes, (23, 23), p=[0.01, 0.3, 0.0, 0.69])
        labels = np.kron(blocks, np.ones((4, 4), np.uint8))
        specks = rng.random(labels.shape) < 0.03
        labels[specks] = rng.choice(classes, int(specks.sum()))
        found = mixed(labels[crop, crop].copy())[radius:-radius, radius:-radius]
        np.testing.assert_array_equal(found, mixed(labels)[inside, inside])


def split(either: np.ndarray, shadow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    person, undecided = either.astype(np.uint8) * 255, shadow.astype(np.uint8) * 255
    split_undecided(person, undecided)
    return person > 0, undecided > 0


def test_person_and_undecided_share_what_is_not_background() -> None:
    either = body() > 0
    shadow = np.zeros(either.shape, bool)
    shadow[70:110, 40:90] = True
    person, undecided = split(either, shadow)
    np.testing.assert_array_equal(person, either & ~shadow)
    np.testing.assert_array_equal(undecided, either & shadow)


def test_specks_and_threads_among_the_undecided_are_undecided() -> None:
    either = body() > 0
    shadow = np.zeros(either.shape, bool)
    shadow[60:100, 60:100] = True
    shadow[80, 70:72] = False  # a speck
    shadow[60:100, 90:92] = False  # a thread of two pixels that hangs from the person
    person, undecided = split(either, shadow)
    assert undecided[80, 70:72].all() and undecided[70:100, 90:92].all()
    np.testing.assert_array_equal(person | undecided, either)
    np.testing.assert_array_equal(person[:59], either[:59])


def test_threads_of_the_person_away_from_undecided_pixels_stay() -> None:
    either = body() > 0
    either[10:20, 80] = True
    shadow = np.zeros(either.shape, bool)
    shadow[90:100, 60:100] = True
    assert split(either, shadow)[0][10:20, 80].all()


@given(hnp.arrays(np.bool_, (12, 17)), hnp.arrays(np.bool_, (12, 17)))
def test_a_split_makes_two_parts_of_one(either: np.ndarray, shadow: np.ndarray) -> None:
    person, undecided = split(either, shadow)
    assert not (person & undecided).any()
    np.testing.assert_array_equal(person | undecided, either)
    assert (undecided >= (either & shadow)).all()
    if not (either & shadow).any():
        np.testing.assert_array_equal(person, either)


@given(hnp.arrays(np.bool_, (13, 13)), hnp.arrays(np.bool_, (13, 13)))
def test_a_split_depends_on_pixels_within_its_radius(
    either: np.ndarray, shadow: np.ndarray
) -> None:
    changed = ~either
    side = slice(6 - SPLIT_RADIUS_PX, 7 + SPLIT_RADIUS_PX)
    near = side, side
    changed[near] = either[near]
    here = [part[6, 6] for part in split(either, shadow)]
    assert here == [part[6, 6] for part in split(changed, shadow)]
