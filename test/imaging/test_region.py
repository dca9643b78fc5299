"""A region gives the same evidence as the whole frame there."""

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import ImagingSettings, Region, Segmenter, learn_background
from markerless_tracker.synthesis import SyntheticScene

SIZE_PX = (240, 180)
WIDE = ImagingSettings.from_mapping(
    {"mask.close_px": 9, "mask.blob_share": 0.02, "mask.hole_share": 0.01}
)


def cluttered(seed: int, channels: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Empty images of a patterned room, and one full of patches, holes, shadows and specks."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(70, 200, (18, 24, channels)).astype(np.uint8)
    base = cv2.resize(coarse, SIZE_PX, interpolation=cv2.INTER_CUBIC)
    base = base.reshape(SIZE_PX[1], SIZE_PX[0], channels).astype(np.float32)
    image = base.copy()
    for _ in range(25):
        centre = (int(rng.integers(0, SIZE_PX[0])), int(rng.integers(0, SIZE_PX[1])))
        axes = (int(rng.integers(1, 40)), int(rng.integers(1, 12)))
        where = np.zeros((SIZE_PX[1], SIZE_PX[0]), np.uint8)
        ring = int(rng.choice([-1, -1, 3]))
        cv2.ellipse(where, centre, axes, float(rng.uniform(0, 180)), 0, 360, 1, ring)
        kind = rng.integers(0, 3)
        if kind == 0:
            image[where > 0] = rng.uniform(0, 255, channels)
        else:
            image[where > 0] = base[where > 0] * rng.uniform(0.2, 0.98)
    shots = [base + rng.normal(0.0, 2.0, base.shape) for _ in range(6)]
    shots.append(image * rng.uniform(0.9, 1.1) + rng.normal(0.0, 2.0, base.shape))
    made = [np.clip(np.rint(shot), 0, 255).astype(np.uint8) for shot in shots]
    made = [shot if channels == 3 else np.ascontiguousarray(shot[:, :, 0]) for shot in made]
    return made[:-1], made[-1]


def compare(
    empty: list[np.ndarray], image: np.ndarray, region: Region, options: ImagingSettings
) -> int:
    segmenter = Segmenter("cam01", learn_background(empty, options), options)
    whole = segmenter.observe(image, 5)
    part = segmenter.observe(image, 5, region)
    assert part.size_px == whole.size_px and part.offset_px == (region.left, region.top)
    np.testing.assert_array_equal(part.mask, whole.mask[region.slices])
    np.testing.assert_array_equal(part.not_background, whole.not_background[region.slices])
    np.testing.assert_array_equal(part.edges, whole.edges[region.slices])
    np.testing.assert_array_equal(segmenter.mask(image, region) > 0, part.mask)
    return int(part.mask.sum())


@pytest.mark.parametrize("channels", [1, 3])
@given(
    seed=st.integers(0, 2**32 - 1),
    across=st.tuples(st.integers(0, 239), st.integers(1, 240)),
    down=st.tuples(st.integers(0, 179), st.integers(1, 180)),
    options=st.sampled_from(
        [
            ImagingSettings(),
            WIDE,
            ImagingSettings.from_mapping(
                {"background.denoise_sigma": 0.0, "shadow.blob_share": 0.01}
            ),
            ImagingSettings.from_mapping({"texture.radius_px": 0, "mask.open_px": 0}),
        ]
    ),
)
@settings(max_examples=40, deadline=None)
def test_a_region_is_cut_from_the_whole(
    channels: int,
    seed: int,
    across: tuple[int, int],
    down: tuple[int, int],
    options: ImagingSettings,
) -> None:
    empty, image = cluttered(seed, channels)
    left, top = across[0], down[0]
    right, bottom = min(left + across[1], SIZE_PX[0]), min(top + down[1], SIZE_PX[1])
    compare(empty, image, Region(left, top, right, bottom), options)


@pytest.mark.parametrize("look", [{}, {"grey": True}, {"shadow": 0.6}], ids=str)
def test_a_region_around_a_person(look: dict[str, Any]) -> None:
    scene = SyntheticScene(body="person31", cameras=1, fps=1.0, size_px=(480, 360), **look)
    empty = next(iter(scene.backgrounds(6).values()))
    images, masks, _ = scene.frame(1)
    (image,), (exact,) = images.values(), masks.values()
    left, top, width, height = cv2.boundingRect(exact.astype(np.uint8))
    for margin in (-20, 0, 25):
        region = Region(left, top, left + width, top + height).grown(margin, (480, 360))
        assert compare(empty, image, region, ImagingSettings()) > 1000


@pytest.mark.parametrize(
    "region", [Region(0, 0, 241, 10), Region(-1, 0, 5, 5), Region(9, 9, 9, 20)]
)
def test_a_region_must_lie_in_the_image(region: Region) -> None:
    empty, image = cluttered(0, 3)
    segmenter = Segmenter("cam07", learn_background(empty))
    with pytest.raises(ImageError, match="cam07: got a region of .* image of 240x180 px"):
        segmenter.observe(image, 0, region)


def test_growing_stops_at_the_image() -> None:
    region = Region(5, 10, 20, 30)
    assert region.grown(8, (100, 35)) == Region(0, 2, 28, 35)
    assert (region.width, region.height) == (15, 20)
    assert region.relative_to(Region(5, 8, 50, 50)) == Region(0, 2, 15, 22)


def test_the_margin_that_an_image_needed_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    *empty, image = np.rint(rng.normal(120.0, 2.0, (9, 180, 240, 3))).astype(np.uint8)
    # A bar, of which a small part lies near the region.
    image[80:100] = 220
    options = ImagingSettings.from_mapping({"mask.blob_share": 0.02})
    segmenter = Segmenter("cam01", learn_background(empty, options), options)
    region = Region(100, 60, 120, 75)
    tried: list[int] = []
    once = Segmenter._try_silhouette

    def counted(self: Segmenter, image: np.ndarray, need: Region, slack: int) -> Any:
        tried.append(slack)
        return once(self, image, need, slack)

    monkeypatch.setattr(Segmenter, "_try_silhouette", counted)
    segmenter.mask(image, region)
    first = list(tried)
    assert len(first) > 1
    for _ in range(8):
        tried.clear()
        segmenter.mask(image, region)
        assert tried == first[-1:]
    tried.clear()
    segmenter.mask(image, region)
    assert tried == first
