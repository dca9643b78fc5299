"""Sums over images that come one by one."""

import numpy as np
import pytest

from markerless_tracker.imaging.background.moments import Moments


@pytest.mark.parametrize("shape", [(6, 8), (6, 8, 3)])
def test_they_are_those_of_all_images_together(shape: tuple[int, ...]) -> None:
    images = np.random.default_rng(4).integers(0, 256, (9, *shape), dtype=np.uint8)
    moments = Moments()
    for image in images:
        moments.add(image)
    values = images.reshape(9, 6, 8, -1).astype(np.float64)
    assert moments.count == 9
    np.testing.assert_allclose(moments.mean, values.mean(axis=0), atol=1e-3)
    np.testing.assert_allclose(moments.squares, 9 * values.var(axis=0), rtol=1e-4)
