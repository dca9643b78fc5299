import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.errors import ImageError
from markerless_tracker.imaging import check_image, scale_image
from markerless_tracker.imaging.images import grey_of


def test_scaling_to_its_own_size_is_the_same_object() -> None:
    image = np.zeros((6, 8, 3), np.uint8)
    assert scale_image(image, (8, 6)) is image


@given(st.integers(1, 40), st.integers(1, 40), st.booleans())
def test_any_size_comes_out(width: int, height: int, colour: bool) -> None:
    image = np.full((13, 17, 3) if colour else (13, 17), 77, np.uint8)
    scaled = scale_image(image, (width, height))
    assert scaled.shape == ((height, width, 3) if colour else (height, width))
    assert (scaled == 77).all()


def test_half_size_averages_two_by_two() -> None:
    image = np.random.default_rng(0).integers(0, 256, (8, 10), dtype=np.uint8)
    mean = image.reshape(4, 2, 5, 2).astype(float).mean(axis=(1, 3))
    assert np.abs(scale_image(image, (5, 4)) - mean).max() <= 0.5


@pytest.mark.parametrize("size", [(0, 5), (5, -1)])
def test_impossible_sizes(size: tuple[int, int]) -> None:
    with pytest.raises(ImageError, match="at least 1x1"):
        scale_image(np.zeros((4, 4), np.uint8), size)


@pytest.mark.parametrize(
    "image",
    [
        None,
        [[1, 2], [3, 4]],
        np.zeros((4, 4), np.float32),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4,), np.uint8),
        np.zeros((0, 4), np.uint8),
    ],
)
def test_other_values_are_refused_with_their_name(image: object) -> None:
    with pytest.raises(ImageError, match="^camX: got") as caught:
        check_image(image, "camX")
    assert "\n" not in str(caught.value)


def test_another_size_is_refused_with_both_sizes() -> None:
    with pytest.raises(ImageError, match="7x5 px, expected 5x7 px"):
        check_image(np.zeros((5, 7), np.uint8), "camX", size_px=(5, 7))


def test_three_equal_channels_keep_their_value() -> None:
    grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert (grey_of(np.repeat(grey[:, :, None], 3, axis=2)) == grey).all()
    assert grey_of(grey) is grey
