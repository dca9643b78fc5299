"""A pixel whose floor point another camera sees in full light is no shadow on the floor."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import project_camera
from markerless_tracker.records import pack_mask
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.floor import (
    PENUMBRA_PX,
    FloorView,
    floor_points,
    lit_elsewhere,
)


@pytest.fixture(scope="module")
def rig():
    return SyntheticScene(body="person31", motion="stand", size_px=(328, 245), seed=3).rig


def view(camera, undecided=None, lit=None, hidden=None, offset_px=(0, 0)) -> FloorView:
    """All that is neither lit nor undecided is person."""
    width, height = camera.size_px
    width -= offset_px[0]
    nothing = np.zeros((height - offset_px[1], width), dtype=np.bool_)
    undecided, lit, hidden = (nothing if m is None else m for m in (undecided, lit, hidden))
    # Whatever is lit has as much background around it as it needs.
    clear = cv2.dilate(lit.astype(np.uint8), np.ones((2 * PENUMBRA_PX + 1,) * 2, np.uint8)) > 0
    masks = (pack_mask(mask) for mask in (~clear & ~undecided, undecided, hidden))
    return FloorView(camera, offset_px, width, *masks)


def marked(camera, points, offset_px=(0, 0)):
    width, height = camera.size_px
    mask = np.zeros((height - offset_px[1], width - offset_px[0]), dtype=np.bool_)
    u, v = (np.round(project_camera(points, camera)).astype(int) - offset_px).T
    inside = (u >= 0) & (v >= 0) & (u < mask.shape[1]) & (v < mask.shape[0])
    mask[v[inside], u[inside]] = True
    return mask


FLOOR = np.array([[0.3, 0.2, 0.0], [-0.4, 0.1, 0.0], [0.0, -0.5, 0.0]])


def test_a_floor_point_is_found_again_from_its_pixel(rig) -> None:
    for camera in rig:
        found = floor_points(project_camera(FLOOR, camera), camera)
        np.testing.assert_allclose(found, FLOOR, atol=1e-6)


def test_through_a_lens_the_rays_are_opencvs(rig) -> None:
    camera = replace(rig.cameras[0], distortion=np.array([-0.3, 0.12, 0.002, -0.001, -0.02]))
    pixels = np.random.default_rng(0).uniform((0, 0), camera.size_px, (50, 2))
    rays = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
    directions = np.column_stack([rays, np.ones(50)]) @ camera.T_world_cam[:3, :3].T
    down = directions[:, 2] < 0
    centre = camera.T_world_cam[:3, 3]
    expected = centre - centre[2] / directions[down, 2:] * directions[down]
    found = floor_points(pixels, camera)
    np.testing.assert_allclose(found[down], expected, rtol=1e-9, atol=1e-9)
    assert np.isnan(found[~down]).all() and down.any()


def test_rays_that_do_not_meet_the_floor_have_no_point(rig) -> None:
    camera = rig.cameras[0]
    up = camera.T_world_cam[:3, 3] + [0.0, 0.0, 5.0] + 5.0 * camera.T_world_cam[:3, 2]
    assert np.isnan(floor_points(project_camera(up[None], camera), camera)).all()


def test_one_camera_that_sees_it_lit_decides_unless_another_sees_it_darkened(rig) -> None:
    first, second = rig.cameras[:2]
    lit = view(first, lit=marked(first, FLOOR))
    dark = view(second, undecided=marked(second, FLOOR[:1]))
    np.testing.assert_array_equal(lit_elsewhere(FLOOR, [lit]), [True, True, True])
    np.testing.assert_array_equal(lit_elsewhere(FLOOR, [lit, dark]), [False, True, True])
    np.testing.assert_array_equal(lit_elsewhere(FLOOR, [dark]), [False, False, False])
    assert not lit_elsewhere(np.full((2, 3), np.nan), [lit, dark]).any()
    assert not lit_elsewhere(FLOOR, []).any()


def test_what_the_body_hides_says_nothing(rig) -> None:
    first, second = rig.cameras[:2]
    there = marked(first, FLOOR[:1])
    hidden = view(first, lit=marked(first, FLOOR), hidden=there)
    np.testing.assert_array_equal(lit_elsewhere(FLOOR, [hidden]), [False, True, True])
    covered = view(second, undecided=marked(second, FLOOR), hidden=marked(second, FLOOR))
    lit = view(first, lit=marked(first, FLOOR))
    assert lit_elsewhere(FLOOR, [lit, covered]).all()


def test_a_window_says_the_same_as_its_frame(rig) -> None:
    camera = rig.cameras[0]
    u, v = (np.floor(project_camera(FLOOR, camera).min(axis=0)) - 3).astype(int)
    window = view(camera, lit=marked(camera, FLOOR, (u, v)), offset_px=(u, v))
    assert lit_elsewhere(FLOOR, [window]).all()


def test_background_beside_the_person_may_be_half_in_shadow(rig) -> None:
    camera = rig.cameras[0]
    for gap, lit in ((PENUMBRA_PX, False), (PENUMBRA_PX + 1, True)):
        u, v = np.round(project_camera(FLOOR[:1], camera)).astype(int)[0]
        seen = view(camera, lit=marked(camera, FLOOR[:1]))
        person = np.zeros(camera.size_px[::-1], dtype=np.bool_)
        person[v + gap, u] = True
        seen = seen._replace(person=pack_mask(person))
        assert lit_elsewhere(FLOOR[:1], [seen]).all() == lit


def test_no_pixels_have_no_floor_points(rig) -> None:
    assert floor_points(np.empty((0, 2)), rig.cameras[0]).shape == (0, 3)
