"""Person, background and undecided: what is undecided, and that a region changes nothing."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.imaging import ImagingSettings, Region, Segmenter, learn_background
from markerless_tracker.imaging.segmentation import segmenter as segmenter_module

SIZE_PX = (200, 150)
PLAIN = ImagingSettings.from_mapping({"background.exposure_compensation": False})


def with_noise(image: np.ndarray, seed: int, sigma: float = 2.0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, sigma, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def learned(empty: np.ndarray, settings: ImagingSettings | None = None) -> Segmenter:
    background = learn_background([with_noise(empty, seed) for seed in range(12)])
    return Segmenter("cam01", background, settings)


def textured(seed: int = 0) -> np.ndarray:
    """A room (150, 200, 3): coarse colours, and boards on the floor."""
    colours = np.random.default_rng(seed).integers(90, 200, (9, 12, 3)).astype(np.uint8)
    image = cv2.resize(colours, SIZE_PX, interpolation=cv2.INTER_CUBIC)
    image[100:, ::8] = image[100:, ::8] // 2
    return image


def peopled(room: np.ndarray) -> np.ndarray:
    """A person with trousers of the room's colours, their shadow, and small things."""
    image = room.astype(float)
    shadow = np.zeros(room.shape[:2], np.uint8)
    cv2.ellipse(shadow, (60, 125), (50, 12), 0, 0, 360, 1, -1)
    image[shadow > 0] *= 0.65
    legs = np.zeros_like(shadow)
    cv2.ellipse(legs, (105, 105), (13, 32), 0, 0, 360, 1, -1)
    image[legs > 0] = 0.8 * room[legs > 0].mean(axis=0)
    cv2.ellipse(image, (105, 55), (17, 33), 4, 0, 360, (20, 30, 60), -1)
    image[12:18, 150:190] = (20, 210, 230)
    image[140:150, 170:185] *= 0.7
    image[20:90, 125:185] += 5.0
    image[100:135, 140:180] = np.linspace(6.0, 18.0, 35)[:, None, None] + room[100:135, 140:180]
    image[10:90, 15:60] -= np.linspace(0.0, 12.0, 45)[:, None]
    return np.asarray(image)


@pytest.fixture(scope="module", params=["colour", "grey"])
def room(request):
    """A segmenter, an image, and what the whole frame gives."""
    empty, image = textured(), peopled(textured())
    if request.param == "grey":
        empty, image = (a.mean(axis=2) for a in (empty, image))
    segmenter = learned(empty)
    image = with_noise(image, 99)
    person, undecided = segmenter.classes(image)
    assert undecided is not None
    return segmenter, image, person.copy(), undecided.copy()


def test_the_scene_has_pixels_of_every_class(room) -> None:
    _, _, person, undecided = room
    assert person.any() and undecided.any() and not (person & undecided).any()
    assert (person[30:80, 98:112] > 0).mean() > 0.9
    assert (undecided[120:130, 20:80] > 0).mean() > 0.5
    assert (undecided[40:80, 50:58] > 0).mean() > 0.2 and not undecided[5:80, 70:85].any()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 190), st.integers(0, 140), st.integers(1, 60), st.integers(1, 60))
def test_a_region_gives_what_the_frame_gives(room, left, top, width, height) -> None:
    segmenter, image, person, undecided = room
    region = Region(left, top, min(left + width, SIZE_PX[0]), min(top + height, SIZE_PX[1]))
    # A wide margin at first would hide one that is too small.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segmenter_module, "_SLACK_PX", 1)
        mask, open_ = segmenter.classes(image, region)
    np.testing.assert_array_equal(mask, person[region.slices])
    np.testing.assert_array_equal(open_, undecided[region.slices])


def test_two_classes_leave_nothing_undecided(room) -> None:
    segmenter, image, _, _ = room
    two = ImagingSettings.from_mapping({"shadow.undecided": False})
    segmenter = Segmenter("cam01", segmenter.background, two)
    assert segmenter.classes(image)[1] is None
    assert segmenter.observe(image, 0).undecided is None


def test_an_observation_holds_the_classes(room) -> None:
    segmenter, image, person, undecided = room
    seen = segmenter.observe(image, 5)
    np.testing.assert_array_equal(seen.mask, person > 0)
    np.testing.assert_array_equal(seen.undecided, undecided > 0)


def flat(level: float, channels: int) -> np.ndarray:
    return np.full((120, 160, 3) if channels == 3 else (120, 160), level)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("step", [-7.0, 7.0])
def test_a_patch_nearly_of_the_backgrounds_colour_is_undecided(channels: int, step: float) -> None:
    """No single pixel differs clearly: the noise is of the same size."""
    segmenter = learned(flat(120.0, channels), PLAIN)
    image = flat(120.0, channels)
    image[30:90, 50:110] += step
    person, undecided = segmenter.classes(with_noise(image, 50))
    assert (undecided[34:86, 54:106] > 0).mean() > 0.95
    away = np.ones(person.shape, bool)
    away[24:96, 44:116] = False
    assert not undecided[away].any()
    assert not person[away].any() and (person > 0).mean() < 1e-3


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("step", range(6, 25, 2))
def test_clothes_of_which_the_noise_hides_some_pixels_are_not_background(
    channels: int, step: float
) -> None:
    """Some of their pixels differ clearly, the others do not: no class covers them alone."""
    segmenter = learned(flat(120.0, channels), PLAIN)
    image = flat(120.0, channels)
    image[30:90, 50:110] += step
    person, undecided = segmenter.classes(with_noise(image, 50))
    assert ((person | undecided)[32:88, 52:108] > 0).mean() > 0.97
    assert ((person | undecided) > 0).sum() < 1.1 * 60 * 60


@pytest.mark.parametrize("channels", [1, 3])
def test_clothes_of_which_half_of_the_pixels_differ_are_a_person(channels: int) -> None:
    segmenter = learned(flat(120.0, channels), PLAIN)
    image = flat(120.0, channels)
    image[30:90, 50:110] += 12.0
    person, _ = segmenter.classes(with_noise(image, 50))
    assert (person[32:88, 52:108] > 0).mean() > 0.95


@pytest.mark.parametrize("channels", [1, 3])
def test_plain_noise_is_background(channels: int) -> None:
    segmenter = learned(flat(120.0, channels), PLAIN)
    for seed in range(50, 56):
        person, undecided = segmenter.classes(with_noise(flat(120.0, channels), seed))
        assert not person.any() and not undecided.any()


def test_patches_are_compared_only_if_asked_for() -> None:
    image = flat(120.0, 3)
    image[30:90, 50:110] += 7.0
    without = ImagingSettings.from_mapping(
        {"background.exposure_compensation": False, "shadow.weak_sigmas": 0.0}
    )
    person, undecided = learned(flat(120.0, 3), without).classes(with_noise(image, 50))
    assert not person[34:86, 54:106].any() and not undecided[34:86, 54:106].any()
