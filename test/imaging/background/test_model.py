import math

import numpy as np
import pytest
from scipy import stats

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import BackgroundModel, ImagingSettings, learn_background
from markerless_tracker.imaging.background.model import foreground_limit


def noisy(rng: np.random.Generator, count: int, sigma: float, *, grey: bool = False) -> list:
    scene = rng.integers(60, 200, (24, 30) if grey else (24, 30, 3)).astype(float)
    frames = [np.clip(scene + rng.normal(0, sigma, scene.shape), 0, 255) for _ in range(count)]
    return [np.rint(frame).astype(np.uint8) for frame in frames]


@pytest.mark.parametrize("grey", [False, True])
def test_mean_and_variance_agree_with_numpy(grey: bool) -> None:
    frames = noisy(np.random.default_rng(1), 200, 6.0, grey=grey)
    model = learn_background(iter(frames))
    stack = np.stack(frames).reshape(200, 24, 30, -1).astype(float)
    assert np.abs(model.mean - stack.mean(axis=0)).max() < 1e-3
    # Four of the 203 frames' weight are the image's median variance.
    assert np.abs(model.variance / stack.var(axis=0, ddof=1) - 1).max() < 0.05
    assert model.channels == (1 if grey else 3)
    assert model.size_px == (30, 24)
    assert "200 frames" in model.note


def test_few_frames_never_claim_a_noise_below_the_floor() -> None:
    frame = np.full((5, 6, 3), 90, np.uint8)
    model = learn_background(
        [frame, frame, frame], ImagingSettings.from_mapping({"background.sigma_min": 3.0})
    )
    assert (model.variance == 9.0).all()


def test_a_single_still_says_what_it_assumes() -> None:
    model = learn_background(
        [np.full((5, 6, 3), 90, np.uint8)],
        ImagingSettings.from_mapping({"background.sigma_still": 7.0}),
    )
    assert (model.variance == 49.0).all()
    assert "still" in model.note and "7" in model.note


def test_models_are_read_only() -> None:
    model = learn_background([np.zeros((5, 6, 3), np.uint8)])
    for array in (model.mean, model.variance):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0, 0] = 1.0


def test_no_frame_and_mixed_frames_name_the_camera() -> None:
    with pytest.raises(ImageError, match="cam07: no background frame"):
        learn_background([], camera="cam07")
    frames = [np.zeros((5, 6, 3), np.uint8), np.zeros((5, 7, 3), np.uint8)]
    with pytest.raises(ImageError, match="cam07: background frame 1"):
        learn_background(frames, camera="cam07")


@pytest.mark.parametrize(
    ("mean", "variance"),
    [
        (np.zeros((4, 5)), np.ones((4, 5))),
        (np.zeros((4, 5, 2)), np.ones((4, 5, 2))),
        (np.zeros((4, 5, 3)), np.ones((4, 5, 1))),
        (np.zeros((4, 5, 3)), np.zeros((4, 5, 3))),
        (np.full((4, 5, 3), np.nan), np.ones((4, 5, 3))),
        (np.zeros((0, 5, 3)), np.ones((0, 5, 3))),
    ],
)
def test_what_is_no_model_is_refused(mean: np.ndarray, variance: np.ndarray) -> None:
    with pytest.raises(ImageError, match="^background"):
        BackgroundModel(mean, variance, "")


@pytest.mark.parametrize("channels", [1, 3])
def test_the_limit_is_equation_11(channels: int) -> None:
    """At the limit the density itself, intensities in 0..1, is 1 / (256^c * delta^(c/3))."""
    rng = np.random.default_rng(3)
    variance = rng.uniform(4.0, 60.0, (3, 4, channels))
    risk = 12.0
    limit = foreground_limit(variance.astype(np.float32), risk)
    for v, u in np.ndindex(3, 4):
        sigma = np.sqrt(variance[v, u]) / 255.0
        step = math.sqrt(limit[v, u] / channels) * sigma
        log_density = stats.norm.logpdf(step, 0.0, sigma).sum()
        expected = -(channels * math.log(256.0) + risk * channels / 3.0 * math.log(10.0))
        assert log_density == pytest.approx(expected, rel=1e-5)


def test_no_risk_makes_a_pixel_foreground_at_its_own_mean() -> None:
    wild = np.full((2, 2, 3), 1e6, np.float32)
    assert (foreground_limit(wild, -6.0) >= 1.0).all()
