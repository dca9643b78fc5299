"""The contour is drawn to the contrast beside it, and to nothing else."""

import cv2
import numpy as np
import pytest

from markerless_tracker.imaging import ImagingSettings, Region, Segmenter, learn_background
from markerless_tracker.imaging.segmentation.level_set import refine_contour

SIZE_PX = (200, 160)
NOISE = 4.0


def truth() -> np.ndarray:
    """A figure (h, w) 0 or 255 with a thin limb."""
    mask = np.zeros((SIZE_PX[1], SIZE_PX[0]), np.uint8)
    cv2.ellipse(mask, (90, 80), (30, 50), 0.0, 0.0, 360.0, 255, -1)
    cv2.line(mask, (110, 60), (170, 40), 255, 9)
    return mask


def picture(mask: np.ndarray, channels: int, *, contrast: float = 50.0, seed: int = 0):
    """The figure in front of a wall that grows brighter to the right, as much as the figure is."""
    wall = np.tile(np.linspace(60.0, 60.0 + contrast, SIZE_PX[0]), (SIZE_PX[1], 1))
    image = (wall + contrast * (mask > 0))[:, :, None].repeat(channels, axis=2)
    image += np.random.default_rng(seed).normal(0.0, NOISE, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float(((a > 0) & (b > 0)).sum() / ((a > 0) | (b > 0)).sum())


def refined(image: np.ndarray, mask: np.ndarray, **changes) -> np.ndarray:
    out = mask.copy()
    refine_contour(image, out, **{"iterations": 5, "radius_px": 8, "least": 20.0, **changes})
    assert set(np.unique(out)) <= {0, 255}
    return out


def dented(mask: np.ndarray) -> np.ndarray:
    mask = mask.copy()
    cv2.circle(mask, (60, 80), 3, 0, -1)
    cv2.circle(mask, (90, 131), 4, 255, -1)
    return mask


def shifted(mask: np.ndarray) -> np.ndarray:
    return np.roll(mask, (3, 3), axis=(0, 1))


def grown(mask: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.dilate(mask, np.ones((7, 7), np.uint8)))


def shrunk(mask: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.erode(mask, np.ones((5, 5), np.uint8)))


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("wrong", "least"), [(dented, 0.97), (shifted, 0.97), (grown, 0.97),
                                              (shrunk, 0.97)])  # fmt: skip
def test_a_wrong_contour_goes_back(channels: int, wrong, least: float) -> None:
    right = truth()
    image, mask = picture(right, channels), wrong(right)
    better = refined(image, mask)
    assert iou(better, right) > max(least, iou(mask, right)), (iou(mask, right), iou(better, right))


def test_the_right_contour_stays() -> None:
    right = truth()
    assert iou(refined(picture(right, 3), right), right) > 0.985


def test_without_contrast_it_stays_exactly() -> None:
    mask = shifted(truth())
    image = picture(truth(), 3, contrast=4.0)
    np.testing.assert_array_equal(refined(image, mask), mask)


def test_it_goes_no_further_than_its_iterations() -> None:
    mask = np.roll(truth(), 12, axis=1)
    out = refined(picture(truth(), 3), mask, iterations=2)
    far = (
        cv2.distanceTransform(mask, cv2.DIST_L1, 3),
        cv2.distanceTransform(255 - mask, cv2.DIST_L1, 3),
    )
    assert (out[far[0] > 2] == 255).all() and (out[far[1] > 2] == 0).all()
    assert (out != mask).any()


@pytest.mark.parametrize("channels", [1, 3])
def test_a_region_is_refined_as_the_whole_image(channels: int) -> None:
    nobody = np.zeros_like(truth())
    empty = [picture(nobody, channels, seed=seed) for seed in range(1, 7)]
    if channels == 1:
        empty = [image[:, :, 0] for image in empty]
    background = learn_background(empty)
    image = picture(truth(), channels).reshape(empty[0].shape)
    segmenter = Segmenter(
        "cam01", background, ImagingSettings.from_mapping({"level_set.iterations": 3})
    )
    plain = Segmenter("cam01", background, ImagingSettings())
    whole = segmenter.mask(image).copy()
    assert (whole != plain.mask(image)).any() and iou(whole, truth()) > 0.95
    for region in (Region(40, 20, 150, 120), Region(100, 30, 131, 61), Region(0, 0, 200, 90)):
        np.testing.assert_array_equal(segmenter.mask(image, region), whole[region.slices])
        part = segmenter.observe(image, 0, region)
        np.testing.assert_array_equal(part.mask, whole[region.slices] > 0)
