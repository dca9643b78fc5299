"""Colours of patches: against a slow twin, and what they are for."""

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from markerless_tracker.imaging import ImagingSettings, Segmenter, learn_background
from markerless_tracker.imaging.segmentation import labels as labels_module
from markerless_tracker.imaging.segmentation.kernels import FOREGROUND, SHADOW, coarse
from markerless_tracker.imaging.segmentation.shadow import (
    even_patches,
    inverse_means,
    label_by_patch,
    near_even,
    patch_means,
    shadow_rule,
)

SPREAD, NOISE = np.float32(0.05), np.float32(1.5)
RULE = shadow_rule(ImagingSettings())
SHAPE = (48, 60)
LEFT, TOP = 3, 5


def scene(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A part of an image in uneven light, the larger background, the gain, and labels."""
    rng = np.random.default_rng(seed)
    whole = (SHAPE[0] + TOP + 2, SHAPE[1] + LEFT + 4)
    mean = cv2.resize(
        rng.uniform(20.0, 240.0, (6, 8, 3)).astype(np.float32),
        whole[::-1],
        interpolation=cv2.INTER_CUBIC,
    )
    mean = np.clip(mean, 0.0, 255.0)
    light = cv2.resize(rng.uniform(0.3, 1.1, (4, 5)), SHAPE[::-1])[:, :, None]
    tint = cv2.resize(rng.uniform(0.9, 1.1, (4, 5, 3)), SHAPE[::-1])
    image = mean[TOP:, LEFT:][: SHAPE[0], : SHAPE[1]] * light * tint
    image = np.clip(np.rint(image + rng.normal(0.0, 4.0, image.shape)), 0, 255).astype(np.uint8)
    labels = rng.choice([0, 64, 127, 255], SHAPE, p=[0.2, 0.1, 0.3, 0.4]).astype(np.uint8)
    return image, mean, rng.uniform(0.9, 1.1, 3).astype(np.float32), labels


@example(seed=0)
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_even_patches_are_as_dark_in_all_channels(seed: int) -> None:
    image, mean, gain, labels = scene(seed)
    patch = patch_means(image.transpose(2, 0, 1).copy())
    np.testing.assert_array_equal(patch, cv2.blur(image, (5, 5)).transpose(2, 0, 1))
    even = np.empty(SHAPE, np.uint8)
    inverse = inverse_means(mean.transpose(2, 0, 1))
    even_patches(patch, inverse, gain, SPREAD, NOISE, LEFT, TOP, labels, even)
    patch = patch.transpose(1, 2, 0)
    base = (np.minimum(cv2.blur(mean, (5, 5)) * gain, 255.0))[TOP:, LEFT:][: SHAPE[0], : SHAPE[1]]
    ratio = patch / np.maximum(base, 1.0)
    value, largest = patch.max(axis=2).astype(float), ratio.max(axis=2)
    excess = (largest - ratio.min(axis=2)) * value - (SPREAD * value + NOISE) * largest
    decided = np.abs(excess) > 1e-4
    expected = (excess <= 0.0) & (labels >= SHADOW)
    np.testing.assert_array_equal((even > 0)[decided], expected[decided])
    assert decided.mean() > 0.99
    # A scene may have no even patch, so this holds for one seed.
    assert seed != 0 or 0 < np.count_nonzero(even) < even.size


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_labels_follow_the_rule(seed: int) -> None:
    image, mean, gain, labels = scene(seed)
    rng = np.random.default_rng(seed)
    even = cv2.resize(rng.choice([0, 255], (12, 15)).astype(np.uint8), SHAPE[::-1], None, 0, 0, 0)
    even[labels < SHADOW] = 0
    near = near_even(even)
    np.testing.assert_array_equal(near, cv2.dilate(even, np.ones((5, 5), np.uint8)))
    base = (np.minimum(mean * gain, 255.0)).max(axis=2)[TOP:, LEFT:][: SHAPE[0], : SHAPE[1]]
    value = image.max(axis=2)
    dark = (value >= RULE[0] * base) & (value <= RULE[1] * base)
    expected = labels.copy()
    expected[(labels >= SHADOW) & (even == 0) & (near == 0)] = FOREGROUND
    expected[(labels == FOREGROUND) & (even > 0) & dark] = SHADOW
    first = coarse(mean.transpose(2, 0, 1), np.ones((3, *mean.shape[:2]), np.float32))[0]
    # The labels begin 3 columns and 2 rows inside of the planes.
    planes = np.pad(image.transpose(2, 0, 1), ((0, 0), (2, 0), (3, 0)))
    label_by_patch(planes, 3, 2, first, gain, RULE, near, even, LEFT, TOP, labels)
    close = np.abs(value / np.maximum(base, 1.0) - RULE[0]) < 0.01
    close |= np.abs(value / np.maximum(base, 1.0) - RULE[1]) < 0.01
    np.testing.assert_array_equal(labels[~close], expected[~close])


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    """A slightly blue room (150, 200, 3), brighter to the right."""
    ramp = np.linspace(120.0, 150.0, 200)[None, :, None]
    return np.asarray(ramp * np.ones((150, 1, 1)) * [1.05, 1.0, 0.97])


def noisy(image: np.ndarray, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, 4.0, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def classes(room: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Person and undecided pixels of a noisy image."""
    background = learn_background([noisy(room, seed) for seed in range(10)])
    settings = ImagingSettings.from_mapping({"background.exposure_compensation": False})
    mask, undecided = Segmenter("cam01", background, settings).classes(noisy(image, 99))
    assert undecided is not None
    return mask > 0, undecided > 0


def test_a_noisy_shadow_is_no_person(room: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    shaded = np.zeros(room.shape[:2], np.uint8)
    cv2.ellipse(shaded, (100, 100), (60, 30), 0, 0, 360, 1, -1)
    image = np.where(shaded[:, :, None] > 0, room * 0.55, room)
    person, undecided = classes(room, image)
    assert not person.any() and (undecided & (shaded > 0)).sum() > 0.95 * shaded.sum()
    # By the colours of single pixels a part of it would be.
    monkeypatch.setattr(labels_module.PixelLabeller, "_compare_patches", lambda *_: None)
    assert classes(room, image)[0].sum() > 0.1 * shaded.sum()


@pytest.mark.parametrize("clothes", [(60, 40, 90), (40, 80, 40), (88, 96, 93)])
def test_coloured_clothes_are_a_person(room: np.ndarray, clothes: tuple[int, int, int]) -> None:
    worn = np.zeros(room.shape[:2], np.uint8)
    cv2.ellipse(worn, (100, 80), (18, 50), 0, 0, 360, 1, -1)
    image = np.where(worn[:, :, None] > 0, np.array(clothes, float), room)
    person, _ = classes(room, image)
    assert (person & (worn > 0)).sum() > 0.95 * worn.sum()
    assert (person & (worn == 0)).sum() < 0.03 * worn.sum()
