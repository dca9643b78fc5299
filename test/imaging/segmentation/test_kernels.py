"""The compiled passes against slow twins: NumPy with OpenCV's own HSV conversion."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.imaging.segmentation import kernels
from markerless_tracker.imaging.segmentation.kernels import (
    coarse,
    label_colour,
    label_grey,
    make_row,
)
from markerless_tracker.imaging.segmentation.shadow import shadow_rule

SAME = np.ones(3, np.float32)


def planes(image: np.ndarray) -> np.ndarray:
    """(h, w, c) as (1, c, h, w)."""
    return np.ascontiguousarray(image.transpose(2, 0, 1)[None])


def first(mean: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.float32]:
    """The coarse form of the first Gaussians (h, w, c)."""
    return coarse(planes(mean)[0], planes(scale)[0])


def twin_colour(
    image: np.ndarray, mean: np.ndarray, scale: np.ndarray, options: ImagingSettings
) -> np.ndarray:
    """Labels by whole-image NumPy, HSV by OpenCV."""
    distance = (((image.astype(np.float64) - mean) * scale) ** 2).sum(axis=2)
    hsv = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_BGR2HSV).astype(float)
    base = cv2.cvtColor(mean.astype(np.float32) / 255.0, cv2.COLOR_BGR2HSV).astype(float)
    low, high = options.shadow.value_min * base[..., 2], options.shadow.value_max * base[..., 2]
    turn = np.abs(hsv[..., 0] - base[..., 0])
    turn = np.minimum(turn, 360.0 - turn)
    spread = mean.max(axis=2) - mean.min(axis=2)
    ratio = hsv[..., 2] / np.maximum(base[..., 2], 1e-9)
    dull = spread * ratio < options.shadow.chroma_min
    coloured = image.max(axis=2) > image.min(axis=2)
    shadow = (hsv[..., 2] >= low) & (hsv[..., 2] <= high)
    shadow &= hsv[..., 1] - base[..., 1] <= options.shadow.saturation_max
    shadow &= dull | (coloured & (turn <= options.shadow.hue_max_deg))
    labels = np.where(shadow & options.shadow.removal, 127, 255)
    return np.where(distance > 1.0, labels, 0).astype(np.uint8)


def scene(seed: int, *, channels: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image, mean, scale: shadows, highlights, other colours, and exact repeats."""
    rng = np.random.default_rng(seed)
    mean = rng.uniform(0.0, 255.0, (40, 50, channels)).astype(np.float32)
    gain = rng.uniform(0.3, 1.2, (40, 50, 1))
    image = mean * gain + rng.normal(0.0, 6.0, mean.shape)
    other = rng.random((40, 50)) < 0.3
    image[other] = rng.uniform(0.0, 255.0, (int(other.sum()), channels))
    scale = rng.uniform(0.01, 0.3, mean.shape).astype(np.float32)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), mean, scale


@pytest.mark.parametrize("chosen", [{}, {"shadow.removal": False}, {"shadow.chroma_min": 0.0}])
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40))
@settings(max_examples=30, deadline=None)
def test_marked_pixels_are_split_as_one_by_one(
    chosen: dict[str, object], seed: int, count: int
) -> None:
    rule = shadow_rule(ImagingSettings.from_mapping(chosen))
    rng = np.random.default_rng(seed)
    # Few levels: black, grey, and channels that are alike occur often.
    image = rng.choice(np.array([0, 1, 40, 90, 91, 255], np.uint8), (3, count))
    levels = rng.choice(np.array([0, 40, 90, 100, 180, 255]), (3, count))
    image[:, ::3], levels[:, ::2] = image[:1, ::3], levels[:1, ::2]
    image[:, 1::3] = rng.choice(np.array([90, 91], np.uint8), image[:, 1::3].shape)
    means = (levels * kernels.LEVELS).astype(np.uint16)
    gain = tuple(np.float32(g / kernels.LEVELS) for g in (1.0, 1.0, rng.choice([1.0, 1.2])))
    marks = np.where(rng.random(count) < 0.9, 255, 0).astype(np.uint8)
    found = np.full(count, 7, np.uint8)
    kernels._split_marked(*image, *means, gain, rule, marks, found)
    for j in range(count):
        base = np.minimum(np.array(gain, np.float32) * means[:, j].astype(np.float32), 255.0)
        shadow = kernels.is_shadow(*image[:, j].astype(np.float32), *base, rule)
        assert found[j] == (0 if not marks[j] else kernels.SHADOW if shadow else 255)


@pytest.mark.parametrize("removal", [True, False])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_colour_agrees_with_the_twin(removal: bool, seed: int) -> None:
    options = ImagingSettings.from_mapping({"shadow.removal": removal, "shadow.undecided": False})
    image, mean, scale = scene(seed)
    labels = np.empty((40, 50), np.uint8)
    label_colour(
        planes(image)[0],
        *first(mean, scale),
        planes(mean),
        planes(scale),
        SAME,
        shadow_rule(options),
        0,
        0,
        *make_row(labels.shape[1]),
        labels,
    )
    twin = twin_colour(image, mean, scale, options)
    # float32 and float64 may differ at a threshold.
    assert (labels != twin).mean() < 2e-3
    assert {0, 255} <= set(np.unique(labels))
    assert (127 in labels) == removal


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_grey_is_the_ratio_alone(seed: int) -> None:
    options = ImagingSettings.from_mapping({"shadow.undecided": False})
    image, mean, scale = (x[:, :, 0] for x in scene(seed, channels=1))
    image = np.ascontiguousarray(image)
    labels = np.empty((40, 50), np.uint8)
    rule = shadow_rule(options, grey=True)
    label_grey(
        image,
        *coarse(mean[None], scale[None]),
        mean[None, None],
        scale[None, None],
        SAME[:1],
        rule,
        0,
        0,
        *make_row(labels.shape[1]),
        labels,
    )
    value = image.astype(float)
    shadow = value >= options.shadow.grey_value_min * mean
    shadow &= value <= options.shadow.grey_value_max * mean
    twin = np.where(np.abs((value - mean) * scale) > 1.0, np.where(shadow, 127, 255), 0)
    assert (labels != twin).mean() < 2e-3


@pytest.mark.parametrize(
    ("pixel", "shadow"),
    [
        ((20, 20, 140), True),  # darker red
        ((20, 25, 140), True),  # hue across 0 degrees from the mean's other side
        ((25, 20, 140), True),
        ((140, 20, 20), False),  # blue of the same brightness
        ((20, 20, 230), False),  # brighter
        ((8, 8, 60), False),  # too dark
        ((0, 0, 140), False),  # more saturated
        ((140, 140, 140), False),  # grey where red is expected
    ],
)
def test_shadows_of_a_red_wall(pixel: tuple[int, int, int], shadow: bool) -> None:
    mean = np.array([[[30.0, 28.0, 200.0]]], np.float32)
    image = np.array([[pixel]], np.uint8)
    labels = np.empty((1, 1), np.uint8)
    rule = shadow_rule(ImagingSettings())
    label_colour(
        planes(image)[0],
        *first(mean, np.ones_like(mean)),
        planes(mean),
        planes(np.ones_like(mean)),
        SAME,
        rule,
        0,
        0,
        *make_row(labels.shape[1]),
        labels,
    )
    assert labels[0, 0] == (127 if shadow else 255)


def test_black_is_defined() -> None:
    image = np.zeros((2, 2, 3), np.uint8)
    labels = np.empty((2, 2), np.uint8)
    rule = shadow_rule(ImagingSettings())
    for level in (0.0, 120.0):
        mean = np.full((2, 2, 3), level, np.float32)
        label_colour(
            planes(image)[0],
            *first(mean, np.ones_like(mean)),
            planes(mean),
            planes(np.ones_like(mean)),
            SAME,
            rule,
            0,
            0,
            *make_row(labels.shape[1]),
            labels,
        )
        assert (labels == (0 if level == 0.0 else 255)).all()
