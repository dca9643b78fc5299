"""Bodies drawn by the kernels against those that drawing draws."""

import numpy as np
import pytest

from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness.raster.silhouette import body_masks


@pytest.mark.parametrize("lens", [False, True], ids=["pinhole", "lens"])
@pytest.mark.parametrize("seed", range(4))
def test_masks_are_those_of_drawing(body, elliptic_body, person, rig, lens_rig, make_pose, lens,
                                    seed) -> None:  # fmt: skip
    cameras = (lens_rig if lens else rig).cameras
    for model in (body, elliptic_body, person):
        pose = make_pose(model, np.random.default_rng(seed), spread_m=0.6)
        masks = body_masks(model, pose, cameras)
        assert list(masks) == [camera.name for camera in cameras]
        for camera in cameras:
            drawn = np.asarray(silhouette(model, pose, camera)).astype(bool)
            assert masks[camera.name].shape == drawn.shape and drawn.any()
            # Outlines may differ by a pixel's rounding.
            assert (masks[camera.name] != drawn).sum() <= 0.03 * drawn.sum()


def test_cameras_of_different_sizes(body, rig, lens_rig, pose) -> None:
    from markerless_tracker.synthesis import ring_rig

    cameras = [rig.cameras[0], *ring_rig(2, (100, 270)).cameras[1:]]
    masks = body_masks(body, pose, cameras)
    for camera in cameras:
        alone = body_masks(body, pose, [camera])[camera.name]
        np.testing.assert_array_equal(masks[camera.name], alone)
        assert alone.shape == camera.size_px[::-1]


def test_a_body_out_of_sight_covers_nothing(body, rig, pose) -> None:
    pose[body.index("pelvis_tx")] = 1e6
    assert not any(mask.any() for mask in body_masks(body, pose, rig.cameras).values())
