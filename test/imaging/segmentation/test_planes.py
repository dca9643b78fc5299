"""Channels of a part of an image against NumPy's."""

import numpy as np
import pytest

from markerless_tracker.imaging import Region
from markerless_tracker.imaging.segmentation.planes import split_channels


@pytest.mark.parametrize("part", [(0, 0, 40, 30), (7, 3, 40, 29), (5, 29, 6, 30), (1, 2, 17, 9)])
def test_the_channels_of_a_part(part: tuple[int, int, int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    region = Region(*part)
    planes = np.empty((3, region.height, region.width), np.uint8)
    split_channels(image, region, planes)
    np.testing.assert_array_equal(planes, image[region.slices].transpose(2, 0, 1))


def test_rows_of_the_image_may_lie_apart() -> None:
    image = np.random.default_rng(1).integers(0, 256, (30, 80, 3)).astype(np.uint8)[:, ::2]
    planes = np.empty((3, 5, 8), np.uint8)
    split_channels(image, Region(4, 2, 12, 7), planes)
    np.testing.assert_array_equal(planes, image[2:7, 4:12].transpose(2, 0, 1))
