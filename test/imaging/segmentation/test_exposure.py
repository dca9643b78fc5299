import numpy as np
import pytest

from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.imaging.segmentation.exposure import ExposureMeter


def wall(channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).uniform(60.0, 180.0, (120, 160, channels)).astype(np.float32)


def shot(mean: np.ndarray, gain: object, seed: int = 1, noise_sd: float = 3.0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, noise_sd, mean.shape)
    return np.clip(np.rint(mean * gain + noise), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("gain", [0.7, 0.95, 1.0, 1.05, 1.3])
def test_the_factor_is_found_beside_a_person(gain: float) -> None:
    image = shot(wall(), gain)
    image[20:110, 50:110] = 15
    image[20:60, 50:110] = 200
    assert ExposureMeter(wall()).gain(image) == pytest.approx(gain, rel=0.01)


def test_each_channel_has_its_own_factor() -> None:
    gain = np.array([0.8, 1.0, 1.2], np.float32)
    assert ExposureMeter(wall()).gain(shot(wall(), gain)) == pytest.approx(gain, rel=0.01)


def test_an_image_of_another_scene_gives_no_factor() -> None:
    assert (ExposureMeter(wall(1)).gain(np.zeros((120, 160, 1), np.uint8)) == 1.0).all()
    noise = np.random.default_rng(5).integers(0, 256, (120, 160, 1), dtype=np.uint8)
    assert (ExposureMeter(wall(1)).gain(noise) == 1.0).all()


def test_a_video_that_shifts_grey_levels_is_not_brighter_at_a_wall() -> None:
    """A dark floor has more pixels than a bright wall; the same shift is another factor there."""
    mean = np.full((120, 160, 3), 70.0, np.float32)
    mean[:36] = 171.0
    frames = [shot(mean, 1.0, i, 1.0) for i in range(8)]
    shifted = shot(mean - 4.0, 1.0, 9, 1.0)
    gain = ExposureMeter(mean).gain(shifted)
    assert np.abs(gain * mean - (mean - 4.0)).max() < 2.2
    seen = Segmenter("cam01", learn_background(frames)).observe(shifted, 0)
    assert not seen.not_background.any()


@pytest.mark.parametrize("channels", [1, 3])
def test_an_exposure_step_is_measured_and_the_silhouette_stays_empty(channels: int) -> None:
    mean = wall(channels)
    frames = [shot(mean, 1.0, i) for i in range(8)]
    bright = shot(mean, 1.3, 9)
    if channels == 1:
        frames, bright = [frame[:, :, 0] for frame in frames], bright[:, :, 0]
    segmenter = Segmenter("cam01", learn_background(frames))
    assert not segmenter.observe(bright, 0).mask.any()
    assert segmenter.gain == pytest.approx((1.3,) * channels, rel=0.01)
