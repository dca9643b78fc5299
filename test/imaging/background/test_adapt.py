import numpy as np
import pytest

from markerless_tracker.imaging import ImagingSettings, Region, Segmenter, learn_background

FOLLOW = ImagingSettings.from_mapping(
    {"background.follow_s": 2.0, "background.exposure_compensation": False, "texture.radius_px": 0}
)
STILL = ImagingSettings.from_mapping(
    {"background.exposure_compensation": False, "texture.radius_px": 0}
)


def shot(lamp: float, person: bool, seed: int, channels: int) -> np.ndarray:
    """A wall whose left half gets brighter by ``lamp`` grey levels, maybe with a person."""
    image = np.random.default_rng(seed).normal(110.0, 2.0, (60, 80, channels))
    image[:, :40] += lamp
    if person:
        image[15:45, 50:65] = 20.0
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return image if channels == 3 else image[:, :, 0]


def run(settings: ImagingSettings, channels: int, seconds: float = 12.0) -> list[np.ndarray]:
    empty = [shot(0.0, False, i, channels) for i in range(10)]
    segmenter = Segmenter("cam01", learn_background(empty), settings)
    masks = []
    for i in range(int(seconds * 10)):
        image = shot(0.2 * i, True, 100 + i, channels)
        masks.append(segmenter.observe(image, i * 100_000_000).mask)
    return masks


@pytest.mark.parametrize("channels", [1, 3])
def test_slow_light_is_followed_and_a_motionless_person_stays(channels: int) -> None:
    last = run(FOLLOW, channels)[-1]
    assert not last[:, :38].any()
    assert last[17:43, 52:63].all()
    assert run(STILL, channels)[-1][:, 5:35].mean() > 0.9


def test_the_same_images_give_the_same_masks_again_after_a_reset() -> None:
    empty = [shot(0.0, False, i, 3) for i in range(10)]
    images = [shot(0.2 * i, True, 100 + i, 3) for i in range(60)]
    segmenter = Segmenter("cam01", learn_background(empty), FOLLOW)

    def masks() -> list[bytes]:
        stamps = range(0, 6_000_000_000, 100_000_000)
        pairs = zip(images, stamps, strict=True)
        return [segmenter.observe(image, at).mask.tobytes() for image, at in pairs]

    first = masks()
    segmenter.reset()
    assert masks() == first


def test_nothing_is_learned_across_a_gap_or_backwards() -> None:
    empty = [shot(0.0, False, i, 3) for i in range(10)]
    segmenter = Segmenter("cam01", learn_background(empty), FOLLOW)
    before = segmenter._labeller.background.mean.copy()
    for stamp_ns in (0, 5_000_000_000, 3_000_000_000, 3_000_000_000):
        segmenter.observe(shot(5.0, False, 3, 3), stamp_ns)
    assert (segmenter._labeller.background.mean == before).all()
    for i in range(4):
        segmenter.observe(shot(5.0, False, 3, 3), 3_100_000_000 + i)
    assert (segmenter._labeller.background.mean != before).any()


def test_regions_in_between_do_not_count_as_a_gap() -> None:
    """Two whole images 2 s apart, with regions between them: the background follows."""
    empty = [shot(0.0, False, i, 3) for i in range(10)]
    lit = [shot(6.0, False, 50 + i, 3) for i in range(400)]
    levels = {}
    for every in (0, 20):
        segmenter = Segmenter("cam01", learn_background(empty), FOLLOW)
        for i, image in enumerate(lit):
            whole = every == 0 and i % 20 == 0
            if every == 0 and not whole:
                continue
            region = None if i % 20 == 0 else Region(0, 0, 20, 20)
            segmenter.observe(image, i * 100_000_000, region)
        levels[every] = float(segmenter._labeller.background.mean[0, :, :, :40].mean())
    assert levels[0] == pytest.approx(110.0, abs=0.5)
    assert levels[20] == pytest.approx(116.0, abs=0.5)


def test_an_image_whose_region_was_looked_at_first_is_followed_too() -> None:
    """As where a body leaves the region around its prediction: the whole image is used then."""
    empty = [shot(0.0, False, i, 3) for i in range(10)]
    once, twice, never = (Segmenter("cam01", learn_background(empty), FOLLOW) for _ in range(3))
    for i in range(40):
        image = shot(0.2 * i, True, 100 + i, 3)
        once.observe(image, i * 100_000_000)
        twice.observe(image, i * 100_000_000, Region(40, 5, 75, 55))
        twice.observe(image, i * 100_000_000)
    means = [segmenter._labeller.background.mean for segmenter in (never, once, twice)]
    assert (means[0] != means[1]).any()
    np.testing.assert_array_equal(means[1], means[2])
