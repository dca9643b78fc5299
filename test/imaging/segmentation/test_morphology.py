import cv2
import numpy as np

from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.imaging.segmentation.morphology import (
    clean_mask,
    closing_px,
    drop_blobs,
    fill_holes,
    foreground_mask,
)


def body() -> np.ndarray:
    mask = np.zeros((120, 160), np.uint8)
    mask[20:100, 60:100] = 255
    return mask


def test_specks_go_and_the_body_stays() -> None:
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
    fill_holes(mask, 10)
    assert mask[40, 70] == 255 and mask[70, 80] == 0


def test_a_gap_open_to_the_outside_is_no_hole() -> None:
    mask = body()
    mask[50, 60:64] = 0
    fill_holes(mask, 10)
    assert (mask[50, 60:64] == 0).all()


def test_small_images_are_closed_less() -> None:
    options = ImagingSettings.from_mapping({"mask.close_px": 5})
    sides = [
        closing_px(options, w * h) for w, h in ((1920, 1080), (640, 480), (320, 240), (64, 48))
    ]
    assert sides == [5, 5, 3, 1]
    assert closing_px(ImagingSettings.from_mapping({"mask.close_px": 0}), 640 * 480) == 1


def test_blobs_are_dropped_by_area() -> None:
    mask = np.zeros((50, 50), np.uint8)
    mask[2:5, 2:5] = mask[20:30, 20:30] = 255
    drop_blobs(mask, 10)
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


def test_small_shadow_patches_are_the_person() -> None:
    labels = body()
    labels[30:34, 70:74] = 127
    labels[100:110, 60:140] = 127
    mask = np.empty_like(labels)
    foreground_mask(labels, mask, 50, grey=False)
    assert (mask == body()).all()
    foreground_mask(labels, mask, 0, grey=False)
    assert mask[31, 71] == 0


def test_grey_shadows_are_opened_first() -> None:
    labels = body()
    labels[100:110, 60:140] = 127
    labels[60:100, 80] = 127  # one pixel wide, hangs on the large patch
    mask = np.empty_like(labels)
    foreground_mask(labels, mask, 50, grey=True)
    assert mask[70, 80] == 255 and mask[105, 100] == 0
