"""Made-up pictures: their masks, their noise, their determinism."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers
from markerless_tracker.camera import project_camera
from markerless_tracker.drawing import silhouette
from markerless_tracker.errors import BodyModelError, ConfigError
from markerless_tracker.imaging import ImagingSettings, Segmenter, learn_background
from markerless_tracker.synthesis import SyntheticScene

SMALL = (328, 246)


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(motion="balance", size_px=SMALL, seed=5)


def test_frames_hold_every_camera(scene) -> None:
    images, masks, pose = scene.frame(3)
    assert tuple(images) == tuple(masks) == scene.rig.names == ("cam01", "cam02", "cam03", "cam04")
    for name in images:
        assert images[name].shape == (246, 328, 3) and images[name].dtype == np.uint8
        assert masks[name].shape == (246, 328) and masks[name].dtype == np.bool_
    np.testing.assert_array_equal(pose, scene.pose(3))
    np.testing.assert_array_equal(scene.markers(3), markers(scene.body, pose))


@pytest.mark.parametrize("body", ["balan31", "person31"])
def test_masks_are_the_silhouettes_of_the_body(body) -> None:
    """Drawn by outlines, without the mesh: the same to a few pixels, lens included."""
    strong = (-0.25, 0.08, 0.002, -0.001, 0.0)
    scene = SyntheticScene(body=body, size_px=SMALL, seed=1, distortion=strong, cameras=2)
    for index in (0, 30):
        _, masks, pose = scene.frame(index)
        for camera in scene.rig:
            expected = silhouette(scene.body, pose, camera, samples=5)
            assert expected.sum() > 1000
            assert overlap(masks[camera.name], expected) > 0.995


def test_markers_lie_inside_the_masks(scene) -> None:
    _, masks, _ = scene.frame(0)
    inside = []
    for camera in scene.rig:
        pixels = np.rint(project_camera(scene.markers(0), camera)).astype(int)
        inside.append([masks[camera.name][v, u] for u, v in pixels])
    # Joints at the very end of a cone may fall on its rim.
    assert np.mean(inside) > 0.8


def test_body_and_shadow_are_all_that_differs_from_the_empty_room() -> None:
    clean = SyntheticScene(size_px=SMALL, noise=0.0, shadow=0.0, seed=2)
    dark = SyntheticScene(size_px=SMALL, noise=0.0, shadow=0.4, seed=2)
    empty = clean.backgrounds(1)
    for name, image in clean.frame(0)[0].items():
        mask = clean.frame(0)[1][name]
        changed = (image != empty[name][0]).any(axis=2)
        # A changed pixel that the mask leaves out lies on the rim.
        assert (changed & mask).sum() > 0.99 * mask.sum()
        assert (changed & ~mask).sum() < 0.15 * mask.sum()
        shade = (dark.frame(0)[0][name] != image).any(axis=2)
        assert shade.sum() > 100 and not (shade & mask).sum() > 0.15 * shade.sum()
        inside = dark.frame(0)[0][name][shade & ~changed] / np.maximum(1.0, image[shade & ~changed])
        assert np.percentile(inside, 5) == pytest.approx(0.6, abs=0.02)


def test_the_tracker_s_own_segmentation_finds_the_person(scene) -> None:
    settings = ImagingSettings()
    empty = scene.backgrounds(8)
    images, masks, _ = scene.frame(10)
    for name in scene.rig.names:
        segmenter = Segmenter(name, learn_background(empty[name], settings), settings)
        assert overlap(segmenter.observe(images[name], 0).mask, masks[name]) > 0.9


def test_noise_has_its_deviation_and_no_mean(scene) -> None:
    quiet = SyntheticScene(motion="balance", size_px=SMALL, seed=5, noise=0.0).backgrounds(1)
    for name, (a, b) in scene.backgrounds(2).items():
        error = a.astype(float) - quiet[name][0]
        # Rounding adds a twelfth to the variance.
        assert error.std() == pytest.approx(np.sqrt(9 + 1 / 12 + 1 / 12), rel=0.03)
        assert abs(error.mean()) < 0.1
        other = b.astype(float) - quiet[name][0]
        assert abs((error * other).mean()) < 0.3


def test_everything_depends_on_the_arguments_alone() -> None:
    one, two = (SyntheticScene(size_px=(96, 64), seed=9, motion="jog") for _ in range(2))
    two.frame(0)  # what was asked for before does not matter
    for a, b in zip(one.frame(7)[:2], two.frame(7)[:2], strict=True):
        for name in a:
            np.testing.assert_array_equal(a[name], b[name])
    for name, images in one.backgrounds(3).items():
        np.testing.assert_array_equal(images, two.backgrounds(3)[name])
    other = SyntheticScene(size_px=(96, 64), seed=10, motion="jog")
    assert any((one.frame(7)[0][n] != other.frame(7)[0][n]).any() for n in one.rig.names)


def test_frames_and_cameras_have_noise_of_their_own() -> None:
    still = SyntheticScene(size_px=(96, 64), seed=9, motion="stand", cameras=2)
    quiet = SyntheticScene(size_px=(96, 64), seed=9, motion="stand", cameras=2, noise=0.0)
    noise = [
        still.frame(i)[0][name].astype(float) - quiet.frame(i)[0][name]
        for i in (0, 1)
        for name in still.rig.names
    ]
    for i, a in enumerate(noise):
        for b in noise[:i]:
            assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.05


def test_stamps_and_poses_follow_the_rate() -> None:
    slow, fast = (SyntheticScene(size_px=(32, 32), fps=fps, cameras=1) for fps in (20.0, 60.0))
    assert [fast.stamp_ns(i) for i in range(4)] == [0, 16666667, 33333333, 50000000]
    np.testing.assert_allclose(slow.pose(1), fast.pose(3), atol=1e-12)


def test_a_person_partly_out_of_view_is_cut_off() -> None:
    body = load_body("balan31")
    scene = SyntheticScene(body=body, size_px=(64, 48), cameras=1)
    (renderer,) = scene._renderers.values()
    pose = body.neutral.copy()
    left_of_view = scene.rig["cam01"].T_world_cam[:3, :3] @ [-2.14, 0, 0]
    pose[[body.index(f"pelvis_t{a}") for a in "xyz"]] = np.array([0, 0, 0.85]) + left_of_view
    _, mask = renderer.render(pose, np.random.default_rng(0))
    assert mask[:, 0].any() and not mask[:, 32:].any()
    pose[body.index("pelvis_tx")] += 50.0
    image, mask = renderer.render(pose, np.random.default_rng(0))
    assert not mask.any() and np.isfinite(image).all()


def test_a_person_around_the_camera_does_no_harm() -> None:
    body = load_body("balan31")
    scene = SyntheticScene(body=body, size_px=(64, 48), cameras=1)
    (renderer,) = scene._renderers.values()
    pose = body.neutral.copy()
    pose[[body.index(f"pelvis_t{a}") for a in "xyz"]] = scene.rig["cam01"].T_world_cam[:3, 3]
    image, _ = renderer.render(pose, np.random.default_rng(0))
    assert image.shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("cameras", 0), ("cameras", 100), ("size_px", (8, 100)), ("size_px", (100, 9000)),
        ("fps", 0.0), ("fps", float("nan")), ("noise", -1.0), ("shadow", 1.5), ("samples", 0),
        ("seed", -1), ("motion", "fly"), ("distortion", (0.1,)),
    ],
)  # fmt: skip
def test_impossible_arguments_are_named(argument, value) -> None:
    words = {"size_px": "image", "distortion": "has 1 coefficients"}
    with pytest.raises(ConfigError, match=words.get(argument, argument)):
        SyntheticScene(**{argument: value})


def test_impossible_body_and_stature() -> None:
    with pytest.raises(BodyModelError, match="body 'spider' is unknown"):
        SyntheticScene(body="spider")
    with pytest.raises(BodyModelError, match="stature is 17"):
        SyntheticScene(stature_m=17.0)
