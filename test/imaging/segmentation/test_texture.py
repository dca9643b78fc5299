"""Each texture kernel against a slow NumPy twin, on random images."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from markerless_tracker.imaging import Region
from markerless_tracker.imaging.segmentation.texture import correct_labels
from markerless_tracker.imaging.segmentation.texture import light as lights
from markerless_tracker.imaging.segmentation.texture.correct import apply_light
from markerless_tracker.imaging.segmentation.texture.light import (
    HIDDEN_LEAST,
    OTHER,
    SAME,
    SHOWN_LEAST,
    SPREAD_PX,
    STEP,
    UNKNOWN,
    lit,
    spread_light,
    window_light,
)

FloatImage = NDArray[np.float32]
Levels = NDArray[np.uint8]

SEEDS = st.integers(0, 2**32 - 1)
MOST_RADIUS = 6
RADII = st.integers(1, MOST_RADIUS)
NOISE = np.float32(2.0**2)
few = settings(max_examples=15, deadline=None)


def scene(rng: np.random.Generator, rows: int, columns: int) -> tuple[Levels, FloatImage]:
    """An image (h, w) and its background: patterned and plain, lit, shaded, covered, saturated."""
    mean = np.full((rows, columns), rng.uniform(60.0, 160.0))
    patterned = rng.random((rows, columns)) < 0.5
    patterned = cv2.morphologyEx(patterned.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5))) > 0
    mean += patterned * rng.normal(0.0, 25.0, mean.shape)
    image = mean.copy()
    for _ in range(4):
        top, left = rng.integers(0, rows), rng.integers(0, columns)
        part = np.s_[top : top + rows // 2, left : left + columns // 2]
        kind = rng.integers(0, 4)
        if kind < 2:
            image[part] *= rng.uniform(0.3, 1.0)
        elif kind == 2:
            image[part] = rng.uniform(0.0, 255.0)
        else:
            image[part] = rng.uniform(40.0, 200.0) + rng.normal(0.0, 30.0, image[part].shape)
    image += rng.normal(0.0, rng.uniform(0.5, 4.0), image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), mean.clip(0, 255).astype(np.float32)


# --- sums over windows ------------------------------------------------------------------------


@few
@given(SEEDS)
def test_column_sums_slide_by_a_row(seed: int) -> None:
    rng = np.random.default_rng(seed)
    total, came, gone, other, last = rng.integers(0, 256, (5, 40)).astype(np.int32)
    moved = total.copy()
    lights._slide(moved, came, gone)
    np.testing.assert_array_equal(moved, total + came - gone)
    moved = total.copy()
    lights._slide_product(moved, came, other, gone, last)
    np.testing.assert_array_equal(moved, total + came * other - gone * last)


@few
@given(SEEDS)
def test_grey_levels_of_the_background_are_rounded(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image, mean = rng.integers(0, 256, 40).astype(np.uint8), rng.uniform(0, 255, 40)
    gain, one = np.float32(rng.uniform(0.5, 1.5)), mean.astype(np.float32)
    a, b = np.empty((2, 40), dtype=np.int32)
    lights._whole_levels(image, one, gain, np.float32(274.0), a, b)
    np.testing.assert_array_equal(a, image)
    lit = np.minimum(one * gain, np.where(image >= 250, 255.0, 274.0).astype(np.float32))
    np.testing.assert_array_equal(b, np.floor(lit + np.float32(0.5)))


def slow_light(image: NDArray[np.int64], base: NDArray[np.int64]) -> tuple[float, float]:
    """The light p of one window, and how near its tests are to the other outcome (relative)."""
    if image.sum() == 0 or base.sum() == 0:
        return 0.0, 1.0
    noise = float(NOISE)
    p = image.mean() / base.mean()
    pattern = p * p * base.var()
    rest = (image - p * base).var() - noise
    tests = [
        (pattern, SHOWN_LEAST * noise), (pattern, HIDDEN_LEAST * noise), (rest, SAME * pattern),
        (rest, OTHER * pattern), (rest, noise),
    ]  # fmt: skip
    near = min(abs(x - limit) / (1.0 + abs(limit)) for x, limit in tests)
    if pattern >= SHOWN_LEAST * noise and rest < SAME * pattern:
        return p, near
    if pattern >= HIDDEN_LEAST * noise and rest > OTHER * pattern:
        return -1.0, near
    return (UNKNOWN + p if rest < noise else 0.0), near


@few
@given(SEEDS, RADII, st.integers(3, 30), st.integers(3, 30))
def test_light_of_windows(seed: int, radius: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    image, mean = scene(rng, rows + 4, columns + 3)
    # The part begins inside the background; windows end at the part's border.
    top, left, gain = 2, 1, np.float32(rng.uniform(0.8, 1.2))
    part = np.ascontiguousarray(image[top : top + rows, left : left + columns])
    light = np.empty(part.shape, dtype=np.float32)
    window_light(part, mean, gain, NOISE, radius, left, top, light)
    most = 46340 // (2 * radius + 1) ** 2
    lit_mean = np.minimum(mean * gain, np.where(image >= 250, 255.0, most))
    levels = np.floor(lit_mean + np.float32(0.5)).astype(np.int64)
    base = levels[top : top + rows, left : left + columns]
    for i in range(rows):
        for j in range(columns):
            window = np.s_[max(i - radius, 0) : i + radius + 1, max(j - radius, 0) : j + radius + 1]
            expected, near = slow_light(part[window].astype(np.int64), base[window])
            # Single precision may change the outcome of a test only next to its limit.
            if near > 1e-3:
                assert light[i, j] == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_windows_of_every_kind() -> None:
    """Pattern shown, pattern covered, no pattern, undecided."""
    rng = np.random.default_rng(1)
    pattern = np.rint(100.0 + 30.0 * rng.standard_normal((9, 60))).clip(20, 180)
    mean = pattern.astype(np.float32)
    mean[:, 30:] = 100.0
    image = np.rint(0.5 * mean)
    image[:, 15:30] = rng.integers(20, 200, (9, 15))
    image[:, 45:] = rng.integers(0, 255, (9, 15))
    light = np.empty(image.shape, dtype=np.float32)
    window_light(image.astype(np.uint8), mean, np.float32(1.0), NOISE, 3, 0, 0, light)
    row = light[4]
    assert np.abs(row[3:12] - 0.5).max() < 0.02
    assert (row[19:27] == -1.0).all()
    np.testing.assert_allclose(row[34:42], UNKNOWN + 0.5, atol=1e-3)
    assert (row[49:57] == 0.0).all()


# --- spreading of light -------------------------------------------------------------------------


def taken_over(line: FloatImage) -> NDArray[np.bool_]:
    """Which plain windows of a line take over the light that comes from before them."""
    taken = np.zeros(line.size, dtype=np.bool_)
    near, steps = np.float32(0.0), 0
    for j, p in enumerate(line):
        if p < UNKNOWN:
            near, steps = max(p, np.float32(0.0)), 0
            continue
        own = p - np.float32(UNKNOWN)
        taken[j] = near > 0.0 and abs(own - near) <= np.float32(STEP) and steps < SPREAD_PX
        near, steps = (own, steps + 1) if taken[j] else (np.float32(0.0), 0)
    return taken


def slow_spread(light: FloatImage) -> FloatImage:
    """Both directions along rows, then both along columns."""
    for along in (False, True):
        lines = light.T if along else light
        forward = np.stack([taken_over(line) for line in lines])
        backward = np.stack([taken_over(line[::-1])[::-1] for line in lines])
        spread = np.where(forward | backward, lines - np.float32(UNKNOWN), lines)
        light = spread.T if along else spread
    return light


def random_light(rng: np.random.Generator, rows: int, columns: int) -> FloatImage:
    """Plain windows mostly, whose light drifts by about `STEP`; others of every kind between."""
    steps = rng.uniform(-1.2 * STEP, 1.2 * STEP, (rows, columns))
    drift = np.where(rng.random((rows, columns)) < 0.1, steps, 0.2 * steps)
    p = 0.6 + np.cumsum(drift, axis=1) * 0.5 + np.cumsum(drift, axis=0) * 0.5
    kind = rng.random((rows, columns))
    light = np.where(kind < 0.95, UNKNOWN + p, p)
    light[kind > 0.98] = 0.0
    light[kind > 0.99] = -1.0
    return light.astype(np.float32)


@few
@given(SEEDS, st.integers(1, 40), st.integers(1, 90))
def test_light_spreads_over_plain_windows(seed: int, rows: int, columns: int) -> None:
    light = random_light(np.random.default_rng(seed), rows, columns)
    expected = slow_spread(light)
    spread = np.empty_like(light)
    spread_light(light.copy(), spread)
    np.testing.assert_array_equal(spread, expected)


@pytest.mark.parametrize("along", ["right", "left", "down", "up"])
def test_light_spreads_by_a_limited_distance(along: str) -> None:
    line = np.full(3 * SPREAD_PX, UNKNOWN + 0.5, dtype=np.float32)
    line[0] = 0.5
    expected = line.copy()
    expected[: SPREAD_PX + 1] = 0.5
    if along in ("left", "up"):
        line, expected = line[::-1], expected[::-1]
    shape = (1, line.size) if along in ("right", "left") else (line.size, 1)
    light = np.ascontiguousarray(line).reshape(shape)
    spread = np.empty_like(light)
    spread_light(light, spread)
    np.testing.assert_array_equal(spread.ravel(), expected)


@few
@given(SEEDS)
def test_a_row_takes_over_from_the_row_before(seed: int) -> None:
    light = random_light(np.random.default_rng(seed), 30, 40)
    near = np.zeros(40, dtype=np.float32)
    steps = np.zeros(40, dtype=np.float32)
    out = light.copy()
    for row, written in zip(light, out, strict=True):
        lights._spread_row(row, near, steps, written)
    taken = np.stack([taken_over(column) for column in light.T]).T
    np.testing.assert_array_equal(out, np.where(taken, light - np.float32(UNKNOWN), light))


# --- labels -------------------------------------------------------------------------------------


@few
@given(SEEDS, st.floats(0.1, 0.8), st.floats(0.8, 1.2))
def test_light_out_of_range_is_dropped(seed: int, least: float, most: float) -> None:
    light = np.random.default_rng(seed).uniform(-1.0, 2.0, (20, 30)).astype(np.float32)
    light[3] += UNKNOWN
    low, high = np.float32(least), np.float32(most)
    expected = (light >= low) & (light <= high)
    found, valid = light.copy(), np.empty(light.shape, dtype=np.uint8)
    lit(found, low, high, valid)
    np.testing.assert_array_equal(valid, expected)
    np.testing.assert_array_equal(found, np.where(expected, light, np.minimum(light, 0.0)))


def slow_labels(
    image: Levels,
    base: FloatImage,
    light: FloatImage,
    labels: Levels,
    examined: Levels,
    *,
    agree: np.float32,
    radius: int,
    protect: bool,
    reveal: bool,
) -> Levels:
    """Labels (h, w) corrected pixel by pixel, as `apply_light` documents."""
    out = labels.copy()
    for i, j in np.ndindex(*labels.shape):
        window = light[max(i - radius, 0) : i + radius + 1, max(j - radius, 0) : j + radius + 1]
        near = np.abs(np.float32(image[i, j]) - window * base[i, j]) <= agree
        explained = bool(((window > 0.0) & near).any())
        covered = light[i, j] < 0.0
        if labels[i, j] == 0:
            if reveal and covered and not explained and protect:
                out[i, j] = 255
        elif examined[i, j] != 0 and (labels[i, j] == 255 or protect):
            if explained:
                out[i, j] = 127
            elif covered and protect:
                out[i, j] = 255
    return out


@few
@given(SEEDS, RADII, st.booleans(), st.booleans())
def test_labels_by_light(seed: int, radius: int, protect: bool, reveal: bool) -> None:
    rng = np.random.default_rng(seed)
    image, mean = scene(rng, 30, 34)
    light = np.zeros((30, 34), dtype=np.float32)
    known = rng.random(light.shape)
    light[known < 0.2] = rng.uniform(0.3, 1.0)
    light[known > 0.6] = -1.0
    labels = rng.choice(np.array([0, 127, 255], np.uint8), light.shape)
    examined = rng.choice(np.array([0, 255], np.uint8), light.shape)
    gain, agree = np.float32(1.1), np.float32(12.0)
    square = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    near_valid = cv2.dilate((light > 0.0).astype(np.uint8), square)
    # The arrays of labels begin 3 columns and 2 rows before those of the light.
    wide = np.pad(labels, ((2, 0), (3, 0)))
    wide_examined = np.pad(examined, ((2, 0), (3, 0)))
    part = (4, 5, 30, 28)
    marks = np.zeros(32, np.uint8)
    apply_light(
        image, mean, gain, agree, radius, protect, reveal, 0, 0, light, near_valid, part, (3, 2),
        wide_examined, marks, wide,
    )  # fmt: skip
    expected = labels.copy()
    inner = np.s_[part[1] : part[3], part[0] : part[2]]
    lit = np.where(image >= 250, np.minimum(mean * gain, 255.0), mean * gain)
    expected[inner] = slow_labels(
        image, lit, light, labels, examined, agree=agree, radius=radius, protect=protect,
        reveal=reveal,
    )[inner]  # fmt: skip
    np.testing.assert_array_equal(wide[2:, 3:], expected)


@few
@given(SEEDS, st.integers(1, 4))
def test_correction_of_labels(seed: int, radius: int) -> None:
    """The steps in their order, from the light of the windows on."""
    rng = np.random.default_rng(seed)
    image, mean = scene(rng, 60, 70)
    sigma, gain = float(np.sqrt(NOISE)), 0.95
    labels = rng.choice(np.array([0, 127, 255], np.uint8), image.shape)
    light = np.empty(image.shape, dtype=np.float32)
    window_light(image, mean, np.float32(gain), NOISE, radius, 0, 0, light)
    spread = slow_spread(light)
    inside = (spread >= np.float32(0.2)) & (spread <= np.float32(1.03))
    spread = np.where(inside, spread, np.minimum(spread, np.float32(0.0)))
    expected = slow_labels(
        image, mean * np.float32(gain), spread, labels, labels, agree=np.float32(3.5 * sigma),
        radius=radius, protect=True, reveal=True,
    )  # fmt: skip
    whole = Region(0, 0, 70, 60)
    corrected = labels.copy()
    correct_labels(
        image, mean, gain, sigma, corrected, whole, whole, whole, examined=labels,
        radius=radius, light=(0.2, 1.03), protect=True, reveal=True,
    )  # fmt: skip
    np.testing.assert_array_equal(corrected, expected)
    assert (corrected != labels).any()
