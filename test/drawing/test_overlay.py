"""The body over an image."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES, load_body, markers
from markerless_tracker.camera import project_camera
from markerless_tracker.drawing import draw_overlay, silhouette
from markerless_tracker.drawing.outline import cone_surfaces
from markerless_tracker.drawing.overlay import CENTRE_BGR, LEFT_BGR, RIGHT_BGR, side_colour
from markerless_tracker.errors import ImageError
from markerless_tracker.synthesis import ring_rig

BODY = load_body("balan31")
CAMERA = ring_rig(4, (328, 246)).cameras[0]
POSE = BODY.neutral.copy()
POSE[BODY.index("pelvis_tz")] = 0.85


def blank(*, colour=True):
    return np.full((246, 328, 3) if colour else (246, 328), 90, dtype=np.uint8)


def test_the_input_image_is_not_changed() -> None:
    image = blank()
    drawn = draw_overlay(image, CAMERA, BODY, POSE)
    assert (image == 90).all() and (drawn != 90).any()
    assert drawn.shape == (246, 328, 3) and drawn.dtype == np.uint8


def test_sides_have_their_colours() -> None:
    names = ["l_thigh", "LKnee", "r_forearm", "RWrist", "torso", "head", "Neck"]
    assert [side_colour(n) for n in names] == [LEFT_BGR] * 2 + [RIGHT_BGR] * 2 + [CENTRE_BGR] * 3
    drawn = draw_overlay(blank(), CAMERA, BODY, POSE)
    pixels = project_camera(markers(BODY, POSE), CAMERA)
    for name, (u, v) in zip(MARKER_NAMES, np.rint(pixels).astype(int), strict=True):
        if name in ("LAnkle", "RAnkle", "Head"):
            assert np.abs(drawn[v, u].astype(int) - side_colour(name)).max() < 60


def test_lines_lie_at_the_rim_of_the_body() -> None:
    drawn = (draw_overlay(blank(), CAMERA, BODY, POSE) != 90).any(axis=2)
    mask = silhouette(BODY, POSE, CAMERA)
    inner = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    rim = mask.copy()
    rim[1:-1, 1:-1] &= ~inner
    assert drawn[rim].mean() > 0.97


def test_grey_images_become_colour() -> None:
    np.testing.assert_array_equal(
        draw_overlay(blank(colour=False), CAMERA, BODY, POSE),
        draw_overlay(blank(), CAMERA, BODY, POSE),
    )


def test_a_mask_is_tinted() -> None:
    mask = np.zeros((246, 328), dtype=np.bool_)
    mask[5:9, 5:9] = True
    drawn = draw_overlay(blank(), CAMERA, BODY, POSE, mask=mask)
    assert (drawn[5:9, 5:9] != 90).any(axis=2).all()
    assert (drawn[:5, :12] == 90).all()


def test_a_body_behind_the_camera_draws_nothing() -> None:
    pose = POSE.copy()
    pose[[BODY.index("pelvis_tx"), BODY.index("pelvis_ty")]] = 3 * CAMERA.T_world_cam[:2, 3]
    assert (draw_overlay(blank(), CAMERA, BODY, pose) == 90).all()


def test_a_body_larger_than_the_view() -> None:
    for distance in (0.2, 0.31, 0.5):
        pose = POSE.copy()
        eye, forward = CAMERA.T_world_cam[:3, 3], CAMERA.T_world_cam[:3, 2]
        pose[[BODY.index(f"pelvis_t{axis}") for axis in "xyz"]] = eye + distance * forward
        assert draw_overlay(blank(), CAMERA, BODY, pose).shape == (246, 328, 3)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((10, 10, 3), np.uint8), "cam01: image of 10x10 px, expected 328x246"),
        (np.zeros((246, 328, 4), np.uint8), "cam01: image of shape .* expected 8-bit grey or BGR"),
        (np.zeros((246, 328, 3), np.float32), "cam01: .* type float32, expected 8-bit"),
        (np.zeros(10, np.uint8), r"cam01: image of shape \(10,\)"),
    ],
)
def test_images_of_another_size_or_type_are_errors(image, words) -> None:
    with pytest.raises(ImageError, match=words):
        draw_overlay(image, CAMERA, BODY, POSE)


def test_a_mask_of_another_size_is_an_error() -> None:
    with pytest.raises(ImageError, match=r"cam01: mask of shape \(3, 3\), expected \(246, 328\)"):
        draw_overlay(blank(), CAMERA, BODY, POSE, mask=np.ones((3, 3), dtype=np.bool_))


def test_ellipses_show_the_deviations() -> None:
    def shown(sd: np.ndarray) -> np.ndarray:
        plain = draw_overlay(blank(), CAMERA, BODY, POSE)
        return (draw_overlay(blank(), CAMERA, BODY, POSE, markers_sd_m=sd) != plain).any(axis=2)

    sd = np.full((15, 3), np.nan)
    assert not shown(sd).any(), "unknown deviations draw nothing"
    head = MARKER_NAMES.index("Head")
    sd[head] = (0.01, 0.01, 0.10)
    v, u = np.nonzero(shown(sd))
    centre = project_camera(markers(BODY, POSE), CAMERA)[head]
    ends = markers(BODY, POSE)[head] + np.array([[0.0, 0.0, -0.2], [0.0, 0.0, 0.2]])
    height = np.ptp(project_camera(ends, CAMERA)[:, 1])
    assert np.ptp(v) == pytest.approx(height, abs=3.0), "two deviations up and down"
    assert abs(u.mean() - centre[0]) < 2.0 and np.ptp(u) < 0.3 * height


def test_coarser_surfaces_draw_nearly_the_same() -> None:
    surfaces = cone_surfaces(BODY, end_points=32, sections=1)
    coarse = draw_overlay(blank(), CAMERA, BODY, POSE, surfaces=surfaces).astype(int)
    assert (np.abs(coarse - draw_overlay(blank(), CAMERA, BODY, POSE)) > 60).mean() < 0.002
    np.testing.assert_array_equal(
        draw_overlay(blank(), CAMERA, BODY, POSE, surfaces=cone_surfaces(BODY)),
        draw_overlay(blank(), CAMERA, BODY, POSE),
    )
