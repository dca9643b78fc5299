import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import BackgroundModel, ImagingSettings, Mode, learn_background
from markerless_tracker.imaging.background.model import foreground_limit, risk_of
from markerless_tracker.imaging.segmentation.segmenter import Segmenter

TWO = ImagingSettings.from_mapping({"background.modes": 3})


def blinking(channels: int = 3) -> list[np.ndarray]:
    """A wall with a screen that shows 60 in two frames of three and 180 in the third."""
    frames = []
    for i in range(24):
        rng = np.random.default_rng(i)
        frame = rng.normal(120.0, 2.0, (60, 80, channels))
        frame[10:30, 20:50] = rng.normal(180.0 if i % 3 == 0 else 60.0, 2.0, (20, 30, channels))
        frames.append(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
    return frames if channels == 3 else [frame[:, :, 0] for frame in frames]


@pytest.mark.parametrize("channels", [1, 3])
def test_both_things_that_a_screen_shows_are_background(channels: int) -> None:
    frames = blinking(channels)
    model = learn_background(frames, TWO)
    assert model.mean[20, 30] == pytest.approx(60.0, abs=3.0)
    (mode,) = model.modes
    assert mode.weight[20, 30] == pytest.approx(1 / 3) and mode.weight[50, 60] == 0.0
    assert mode.mean[20, 30] == pytest.approx(180.0, abs=3.0)
    options = ImagingSettings.from_mapping(
        {"background.modes": 3, "background.exposure_compensation": False}
    )
    for frame in frames[:2]:
        assert not Segmenter("cam01", model, options).observe(frame, 0).mask.any()
    brighter = frames[0].copy()
    brighter[10:30, 20:50] = 240
    assert Segmenter("cam01", model, options).observe(brighter, 0).mask[12:28, 22:48].all()
    single = learn_background(frames[:1])
    assert Segmenter("cam01", single).observe(frames[1], 0).mask[20, 30]


def test_one_mode_of_a_quiet_scene_is_the_single_gaussian() -> None:
    rng = np.random.default_rng(0)
    frames = [np.clip(rng.normal(100, 2, (40, 50, 3)), 0, 255).astype(np.uint8) for _ in range(9)]
    one, several = learn_background(frames), learn_background(frames, TWO)
    assert several.modes == ()
    np.testing.assert_allclose(one.mean, several.mean, atol=1e-4)
    np.testing.assert_allclose(one.variance, several.variance, rtol=1e-4)


def test_something_that_passes_once_is_no_mode() -> None:
    frames = blinking()
    frames[5][40:50, 60:70] = 255
    model = learn_background(frames, TWO)
    assert all(mode.weight[45, 65] == 0.0 for mode in model.modes)


def test_a_rare_mode_must_be_met_more_closely() -> None:
    variance = np.full((1, 1, 3), 4.0, np.float32)
    often = foreground_limit(variance, 8.0, weight=np.full((1, 1), 0.9, np.float32))
    seldom = foreground_limit(variance, 8.0, weight=np.full((1, 1), 0.1, np.float32))
    assert often - seldom == pytest.approx(2.0 * np.log(9.0), rel=1e-5)


def test_published_risks_by_camera() -> None:
    options = ImagingSettings.from_mapping({"background.risks": "humaneva", "background.risk": 5.0})
    names = ("C1", "cam02", "Combo_1_(C3)", "C4", "BW1x", "side", "cam17")
    assert [risk_of(name, options) for name in names] == [80.0, 60.0, 30.0, 80.0, 80.0, 5.0, 5.0]
    assert risk_of("C1", ImagingSettings()) == ImagingSettings().background.risk


def test_modes_that_do_not_fit_are_refused() -> None:
    mean = np.zeros((4, 5, 3), np.float32)
    with pytest.raises(ImageError, match="mode of"):
        BackgroundModel(mean, mean + 1, "", (Mode(np.zeros((4, 4)), mean, mean + 1),))
    with pytest.raises(ImageError, match="no Gaussian"):
        BackgroundModel(mean, mean + 1, "", (Mode(np.ones((4, 5)), mean, mean),))
