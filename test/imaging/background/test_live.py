"""Learning an empty scene from images as they come."""

import tracemalloc

import numpy as np
import pytest

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import ImagingSettings, learn_background
from markerless_tracker.imaging.background.live import SAMPLES, LiveBackground


def images(count: int, shape: tuple[int, ...] = (30, 40, 3)) -> list[np.ndarray]:
    rng = np.random.default_rng(5)
    room = rng.uniform(30, 220, shape)
    return [(room + rng.normal(0, 3, shape)).clip(0, 255).astype(np.uint8) for _ in range(count)]


def learned(settings: ImagingSettings, frames: list[np.ndarray]) -> LiveBackground:
    live = LiveBackground("cam01", settings)
    for frame in frames:
        live.add(frame)
    return live


@pytest.mark.parametrize("shape", [(30, 40), (30, 40, 3)])
@pytest.mark.parametrize("count", [1, 7])
def test_it_learns_what_all_images_together_give(shape: tuple[int, ...], count: int) -> None:
    frames = images(count, shape)
    live = learned(ImagingSettings(), frames).learn()
    together = learn_background(frames)
    np.testing.assert_array_equal(live.mean, together.mean)
    np.testing.assert_array_equal(live.variance, together.variance)
    assert live.note == f"learned live from {count} images"


def test_a_mixture_is_learned_from_samples() -> None:
    settings = ImagingSettings.from_mapping({"background": {"modes": 2}})
    frames = images(3 * SAMPLES)
    for number in range(1, len(frames), 2):
        frames[number][10:20, 10:20] = 250
    model = learned(settings, frames[:8]).learn()
    together = learn_background(frames[:8], settings)
    np.testing.assert_array_equal(model.mean, together.mean)
    np.testing.assert_array_equal(model.modes[0].weight, together.modes[0].weight)
    assert abs(learned(settings, frames).learn().mean - together.mean)[25:].max() < 5.0


@pytest.mark.parametrize("modes", [1, 2])
def test_memory_does_not_grow_with_the_images(modes: int) -> None:
    settings = ImagingSettings.from_mapping({"background": {"modes": modes}})
    frames = images(4, (120, 160, 3))
    live = LiveBackground("cam01", settings)
    tracemalloc.start()
    try:
        for number in range(6 * SAMPLES):
            live.add(frames[number % 4])
        held = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert len(live) == 6 * SAMPLES and held < 1.5 * SAMPLES * frames[0].nbytes


def test_an_image_that_differs_is_refused() -> None:
    live = learned(ImagingSettings(), images(2))
    with pytest.raises(ImageError, match=r"cam01: background frame 2 is \(30, 40\), the first"):
        live.add(images(1, (30, 40))[0])
