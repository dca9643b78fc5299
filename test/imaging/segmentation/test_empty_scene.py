"""An empty scene has no person: bright walls in more light, noise on patterns, a slow follower."""

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError
from markerless_tracker.imaging import ImagingSettings, Segmenter, learn_background
from markerless_tracker.imaging.edges import edge_map

SHAPE = (120, 160)


def noisy(image: np.ndarray, seed: int, sigma: float) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def wall(level: float, pattern: float) -> np.ndarray:
    """A grey wall (h, w) with coarse texture."""
    rng = np.random.default_rng(0)
    return np.clip(level + rng.normal(0.0, pattern, SHAPE), 0.0, 255.0)


def stripes() -> np.ndarray:
    """A colour scene (h, w, 3) of narrow stripes, which a blur changes."""
    columns = np.where(np.arange(SHAPE[1]) % 4 < 2, 70.0, 170.0)
    return np.repeat(np.broadcast_to(columns, SHAPE)[:, :, None], 3, axis=2)


@pytest.mark.parametrize("shadow", [1.0, 0.7])
@pytest.mark.parametrize("gain", [1.0, 1.1, 1.2, 1.3])
def test_a_bright_wall_in_more_light_is_no_person(gain: float, shadow: float) -> None:
    """Where it is white, the image has less pattern than the background times the light.

    In a shadow it is not white, and has the whole pattern.
    """
    empty = wall(235.0, 10.0)
    # The brightness is measured where the image is not white.
    empty[:, :80] -= 130.0
    segmenter = Segmenter("cam", learn_background([noisy(empty, s, 2.0) for s in range(12)]))
    lit = empty * gain
    lit[20:60, 100:150] *= shadow
    mask = segmenter.mask(noisy(np.clip(lit, 0.0, 255.0), 99, 2.0))
    assert (mask > 0).mean() < 0.06


def test_the_brightness_of_a_noisy_patterned_scene_is_measured_as_it_is_compared() -> None:
    empty = stripes()
    segmenter = Segmenter("cam", learn_background([noisy(empty, s, 8.0) for s in range(12)]))
    mask, undecided = segmenter.classes(noisy(empty, 99, 8.0))
    np.testing.assert_allclose(segmenter.gain, 1.0, atol=0.01)
    assert undecided is not None and ((mask | undecided) > 0).mean() < 0.02


def test_a_pattern_that_fades_in_is_followed_by_the_texture_test_too() -> None:
    """Sun through blinds on a wall that a grey camera sees."""
    settings = ImagingSettings.from_mapping(
        {"background.follow_s": 0.3, "background.follow_margin_px": 0}
    )
    empty = wall(120.0, 12.0)
    segmenter = Segmenter(
        "cam", learn_background([noisy(empty, s, 2.0) for s in range(12)], settings), settings
    )
    columns = np.arange(SHAPE[1])
    stripes = 1.0 + 0.22 * np.sign(np.sin(1.05 * columns)) * (columns >= 80)
    for t in range(30):
        light = 1.0 + (stripes - 1.0) * min(1.0, t / 22.0)
        observed = segmenter.observe(noisy(empty * light, 100 + t, 2.0), t * 500_000_000)
    assert observed.mask.mean() < 0.02


def test_a_mixture_is_not_blurred() -> None:
    """Pixels beside those with a second Gaussian have none, which a blur would mix in."""
    images = []
    for number in range(20):
        image = np.full(SHAPE, 60.0)
        image[:, 60:65] += 120.0 * (number % 2)
        images.append(noisy(image, number, 8.0))
    settings = ImagingSettings.from_mapping(
        {"background.modes": 2, "background.exposure_compensation": False}
    )
    segmenter = Segmenter("cam", learn_background(images, settings), settings)
    for image in images[:2]:
        mask, undecided = segmenter.classes(image)
        assert not mask.any() and (undecided is None or not undecided.any())


def test_a_background_that_follows_noisy_images_stays() -> None:
    empty = stripes()
    settings = ImagingSettings.from_mapping(
        {"background.follow_s": 0.5, "background.exposure_compensation": False}
    )
    model = learn_background([noisy(empty, s, 8.0) for s in range(12)])
    segmenter = Segmenter("cam", model, settings)
    before = segmenter._labeller.background.mean.copy()
    for index in range(60):
        segmenter.observe(noisy(empty, 100 + index, 8.0), index * 33_000_000)
    assert np.abs(segmenter._labeller.background.mean - before).max() < 8.0


@pytest.mark.parametrize("layout", ["whole", "read-only", "part"])
def test_edges_of_any_grey_image_come_from_one_kind_of_array(
    layout: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that their kernel is compiled once."""
    seen: list[np.ndarray] = []

    def spy(grey: np.ndarray, *rest: object) -> None:
        seen.append(grey)

    monkeypatch.setattr("markerless_tracker.imaging.edges.gradient_strength", spy)
    image = noisy(wall(120.0, 20.0), 0, 2.0)
    if layout == "part":
        image = np.repeat(image, 2, axis=1)[:, ::2]
    image.flags.writeable = layout != "read-only"
    mask = np.zeros(SHAPE, np.uint8)
    mask[30:90, 60:100] = 255
    edge_map(image, mask, ImagingSettings())
    assert [(grey.flags.c_contiguous, grey.flags.writeable) for grey in seen] == [(True, False)]


def test_the_warm_up_reaches_the_kernel_of_a_background_that_follows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[int] = []
    monkeypatch.setattr(
        "markerless_tracker.imaging.background.adapt.adapt_means", lambda *_: calls.append(1)
    )
    settings = ImagingSettings.from_mapping({"background.follow_s": 2.0})
    model = learn_background([noisy(stripes(), s, 2.0) for s in range(8)])
    Segmenter("cam", model, settings).warm_up()
    assert calls


def test_a_range_of_shadows_that_is_empty_is_refused() -> None:
    with pytest.raises(ConfigError, match="shadow.undecided_value_min: got 0.42, expected at most"):
        ImagingSettings.from_mapping({"shadow.value_min": 0.3, "shadow.value_max": 0.4})
