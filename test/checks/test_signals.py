"""Signals of a camera's images."""

import numpy as np

from markerless_tracker.checks.signals import _signals


def test_the_motion_of_the_first_images_is_no_dip() -> None:
    """It would be the same in every camera, in step or not."""
    images = []
    for number in range(10):
        image = np.full((60, 80), 100, np.uint8)
        image[20:40, 5 + 5 * number : 20 + 5 * number] = 200
        images.append(image)
    motion = _signals(images, None, 80, ("grey",), apart=3).motion
    assert motion.min() > 0.0 and (motion[:3] == motion[3]).all()
    assert (_signals(images[:2], None, 80, ("grey",), apart=3).motion == 0.0).all()
