"""The silhouette's border against bodies whose coverage of each pixel is known."""

import cv2
import numpy as np
import pytest

from markerless_tracker.imaging import ImagingSettings, Segmenter, learn_background
from markerless_tracker.imaging.masks import SOLID
from markerless_tracker.imaging.region import Region
from markerless_tracker.imaging.segmentation.border import mark_half_covered, trim_border
from markerless_tracker.imaging.segmentation.kernels import LEVELS

SIZE_PX = (120, 90)


def coverage(centre: tuple[float, float], radius: float) -> np.ndarray:
    """Part of each pixel (h, w) that a disc covers, from 8 x 8 samples."""
    fine = (np.arange(8) + 0.5) / 8.0 - 0.5
    v, u = np.mgrid[0 : SIZE_PX[1], 0 : SIZE_PX[0]].astype(float)
    total = np.zeros(v.shape)
    for dv in fine:
        for du in fine:
            total += np.hypot(u + du - centre[0], v + dv - centre[1]) <= radius
    return total / 64.0


def shot(
    covered: np.ndarray, body: tuple[float, ...], floor: tuple[float, ...], sigma: float, seed: int
) -> np.ndarray:
    image = covered[:, :, None] * np.array(body) + (1.0 - covered[:, :, None]) * np.array(floor)
    image = image + np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("layers", [1, 2])
def test_the_border_is_where_half_a_pixel_is_covered(layers: int) -> None:
    covered = coverage((60.3, 44.6), 25.2)
    body, floor = (30.0, 60.0, 160.0), (120.0, 120.0, 120.0)
    image = shot(covered, body, floor, 0.0, 0)
    mask = ((covered > 0.02) * 255).astype(np.uint8)
    mean = np.empty((3, 90, 120), np.uint16)
    mean[:] = LEVELS * np.array(floor)[:, None, None]
    whole = Region.whole(SIZE_PX)
    planes = image.transpose(2, 0, 1).copy()
    gain = np.ones(3, np.float32)
    trim_border(planes, (0, 0), mean, gain, mask, whole, layers=layers, least=10.0)
    clear = np.abs(covered - 0.5) > 0.05
    assert ((mask > 0) == (covered >= 0.5))[clear].all()


def test_a_body_like_the_background_stays() -> None:
    planes = np.full((1, 90, 120), 100, np.uint8)
    mask = np.zeros((90, 120), np.uint8)
    mask[20:60, 30:70] = 255
    before = mask.copy()
    mean = np.full((1, 90, 120), 98 * LEVELS, np.uint16)
    whole = Region.whole(SIZE_PX)
    gain = np.ones(1, np.float32)
    trim_border(planes, (0, 0), mean, gain, mask, whole, layers=2, least=10.0)
    assert (mask == before).all()


@pytest.mark.parametrize("channels", [1, 3])
def test_the_segmenter_finds_the_area_without_bias(channels: int) -> None:
    floor, body = (130.0, 120.0, 110.0)[:channels], (40.0, 50.0, 200.0)[:channels]
    nothing, covered = np.zeros((90, 120)), coverage((61.2, 45.7), 24.0)
    empty = [shot(nothing, body, floor, 2.0, seed) for seed in range(8)]
    image = shot(covered, body, floor, 2.0, 99)
    if channels == 1:
        empty, image = [frame[:, :, 0] for frame in empty], image[:, :, 0]
    areas = {}
    for layers in (0, 1):
        options = ImagingSettings.from_mapping({"mask.trim_px": layers, "texture.radius_px": 0})
        segmenter = Segmenter("cam01", learn_background(empty, options), options)
        areas[layers] = segmenter.observe(image, 0).mask.sum() / covered.sum()
    assert areas[1] == pytest.approx(1.0, abs=0.01)
    assert areas[0] > 1.02


def twin(image, floor, mask, inner, deep, least):
    """`mark_half_covered` pixel by pixel."""
    cleared = np.zeros_like(mask)
    for i, j in np.argwhere((mask > 0) & (inner == 0)):
        near = np.s_[max(i - 3, 0) : i + 4, max(j - 3, 0) : j + 4]
        source = next((s[near] > 0 for s in (deep, inner) if (s[near] > 0).any()), None)
        if source is None:
            continue
        contrast = image[near][source].mean(axis=0) - floor
        along = (image[i, j] - floor) @ contrast
        if contrast @ contrast >= least and along < 0.5 * contrast @ contrast:
            cleared[i, j] = 255
    return cleared


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("shape", [(40, 33), (5, 9), (1, 4)])
def test_half_covered_pixels_are_those_of_a_slow_twin(shape, channels) -> None:
    rng = np.random.default_rng(channels)
    image = rng.integers(0, 256, (*shape, channels)).astype(np.uint8)
    mask = 255 * (cv2.blur(rng.random(shape), (3, 3)) > 0.42).astype(np.uint8)
    inner = np.asarray(cv2.erode(mask, SOLID), np.uint8)
    deep = np.asarray(cv2.erode(inner, SOLID), np.uint8)
    floor = np.array((90.0, 120.0, 150.0)[:channels])
    mean = np.empty((channels, *shape), np.uint16)
    mean[:] = LEVELS * floor[:, None, None]
    cleared = np.empty_like(mask)
    # The mask begins 2 columns and a row inside of the planes.
    planes = np.pad(image.transpose(2, 0, 1), ((0, 0), (1, 0), (2, 0)))
    rings = np.zeros((2, 8, shape[1]), np.uint32)
    row = np.repeat(np.arange(2, dtype=np.uint8)[:, None], shape[1], axis=1)
    marks = np.zeros((shape[1] + 7) // 8 * 8, np.uint8)
    mark_half_covered(
        planes, 2, 1, mean, np.ones(channels, np.float32), 0, 0, mask, inner, deep,
        np.float32(100.0), rings, row, marks, cleared,
    )  # fmt: skip
    expected = twin(image.astype(float), floor, mask, inner, deep, 100.0)
    np.testing.assert_array_equal(cleared, expected)
    if shape[0] > 30:
        assert (expected > 0).any() and ((mask > 0) & (inner == 0) & (expected == 0)).any()
