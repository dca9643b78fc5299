"""Outlines and silhouettes."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import MARKER_NAMES, cone_transforms, load_body, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.drawing import outlines, silhouette
from markerless_tracker.synthesis import look_at, ring_rig

BODY = load_body("person31")
LENS = (-0.2, 0.06, 0.002, -0.001, 0.0)


def standing(height=0.85):
    pose = BODY.neutral.copy()
    pose[BODY.index("pelvis_tz")] = height
    return pose


def random_pose(seed):
    rng = np.random.default_rng(seed)
    pose = BODY.neutral + rng.uniform(-0.8, 0.8, BODY.size)
    pose[[BODY.index(f"pelvis_t{axis}") for axis in "xyz"]] += [0, 0, 0.85]
    return pose


def inside(polygon, points, slack_px):
    contour = polygon.astype(np.float32)[:, None]
    return [cv2.pointPolygonTest(contour, tuple(map(float, p)), True) >= -slack_px for p in points]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([LENS, (0.0,) * 5]))
def test_outlines_enclose_their_cones_tightly(seed, lens) -> None:
    """Points sampled inside each cone project inside its outline; every corner lies on the cone."""
    rng = np.random.default_rng(seed)
    camera = ring_rig(4, (400, 300), distortion=lens).cameras[rng.integers(4)]
    pose = random_pose(seed)
    for polygon, T, length, shape in zip(
        outlines(BODY, pose, camera), cone_transforms(BODY, pose), BODY.cone_length,
        BODY.cone_shape, strict=True,
    ):  # fmt: skip
        t = rng.uniform(0, 1, 60)
        angle, radius = rng.uniform(0, 2 * np.pi, 60), np.sqrt(rng.uniform(0, 1, 60))
        section = (1 - t)[:, None] * shape[0] + t[:, None] * shape[1]
        x = section[:, 2] + radius * section[:, 0] * np.cos(angle)
        y = section[:, 3] + radius * section[:, 1] * np.sin(angle)
        points = np.column_stack([x, y, t * length]) @ T[:, :3].T + T[:, 3]
        assert all(inside(polygon, project_camera(points, camera), 0.05))
        rim = np.linspace(0, 2 * np.pi, 2000)
        ends = [
            np.column_stack([ox + rx * np.cos(rim), oy + ry * np.sin(rim), np.full(2000, z)])
            for (rx, ry, ox, oy), z in ((shape[0], 0.0), (shape[1], length))
        ]
        pixels = project_camera(np.concatenate(ends) @ T[:, :3].T + T[:, 3], camera)
        hull = cv2.convexHull(pixels.astype(np.float32))[:, 0]
        # Corners lie within the hull of the ends, but for the bend that the lens gives the sides.
        assert all(inside(hull, polygon, 0.3 if any(lens) else 0.01))


def test_an_upright_cylinder_of_known_size() -> None:
    """A cylinder 0.1 m in radius and 0.5 m high, 2 m in front of a camera at half its height."""
    camera = CameraModel(
        "c", (400, 400), np.array([[500.0, 0, 200], [0, 500, 200], [0, 0, 1]]), np.zeros(5),
        look_at(np.array([-2.0, 0, 0.25]), np.array([0, 0, 0.25])),
    )  # fmt: skip
    body = load_body("balan31")
    shapes, lengths = body.cone_shape.copy(), body.cone_length.copy()
    shapes[0], lengths[0] = [[0.1, 0.1, 0, 0]] * 2, 0.5
    body = dataclasses.replace(body, cone_shape=shapes, cone_length=lengths)
    polygon = outlines(body, body.neutral, camera)[0]
    # Sides touch at sin(a) = 0.1 / 2; ends are highest at the near rim, 1.9 m away.
    half = 500 * np.tan(np.arcsin(0.1 / 2))
    np.testing.assert_allclose(polygon[:, 0].max() - 200, half, atol=0.05)
    np.testing.assert_allclose(200 - polygon[:, 0].min(), half, atol=0.05)
    np.testing.assert_allclose(polygon[:, 1].max() - 200, 500 * 0.25 / 1.9, atol=0.05)
    np.testing.assert_allclose(200 - polygon[:, 1].min(), 500 * 0.25 / 1.9, atol=0.05)


def test_silhouette_is_the_union_of_the_filled_outlines() -> None:
    camera = ring_rig(4, (328, 246), distortion=LENS).cameras[1]
    mask = silhouette(BODY, standing(), camera)
    filled = np.zeros(mask.shape, dtype=np.uint8)
    for polygon in outlines(BODY, standing(), camera):
        cv2.fillConvexPoly(filled, np.rint(polygon * 256).astype(np.int32), 1, shift=8)
    # OpenCV also fills what the outline merely touches.
    assert not (mask & (filled == 0)).any()
    grown = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3)))
    assert not ((filled == 1) & (grown == 0)).any()


def test_pixel_centres_decide_without_samples() -> None:
    camera = ring_rig(1, (120, 90)).cameras[0]
    mask = silhouette(BODY, standing(), camera)
    polygons = outlines(BODY, standing(), camera)
    rng = np.random.default_rng(0)
    for u, v in np.column_stack([rng.integers(0, 120, 600), rng.integers(0, 90, 600)]):
        distances = [
            cv2.pointPolygonTest(p.astype(np.float32)[:, None], (float(u), float(v)), True)
            for p in polygons
        ]
        if abs(max(distances)) > 1e-3:
            assert mask[v, u] == (max(distances) > 0)


def test_samples_converge() -> None:
    camera = ring_rig(2, (120, 90)).cameras[1]
    fine = silhouette(BODY, standing(), camera, samples=9)
    for samples, most in ((1, 0.03), (3, 0.015), (5, 0.01)):
        mask = silhouette(BODY, standing(), camera, samples=samples)
        assert (mask ^ fine).sum() <= most * fine.sum()


def test_only_selected_cones_are_drawn() -> None:
    camera = ring_rig(4, (328, 246)).cameras[0]
    every = silhouette(BODY, standing(), camera)
    parts = np.zeros_like(every)
    for i in range(len(BODY.cone_names)):
        part = silhouette(BODY, standing(), camera, cones=np.arange(len(BODY.cone_names)) == i)
        assert part.any()
        parts |= part
    np.testing.assert_array_equal(parts, every)


def test_a_body_outside_the_view_has_no_silhouette() -> None:
    camera = ring_rig(1, (120, 90)).cameras[0]
    behind = standing()
    eye = camera.T_world_cam[:3, 3]
    behind[[BODY.index("pelvis_tx"), BODY.index("pelvis_ty")]] = 3 * eye[:2]
    assert not silhouette(BODY, behind, camera).any()
    assert all(polygon.shape == (0, 2) for polygon in outlines(BODY, behind, camera))
    beside = standing()
    beside[[BODY.index("pelvis_tx"), BODY.index("pelvis_ty")]] = np.array([-eye[1], eye[0]])
    assert not silhouette(BODY, beside, camera).any()


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 3)])
def test_tiny_images(size) -> None:
    camera = ring_rig(1, (120, 90)).cameras[0].resized(size)
    assert silhouette(BODY, standing(), camera, samples=2).shape == size[::-1]


def test_joints_lie_inside() -> None:
    camera = ring_rig(4, (656, 490), distortion=LENS).cameras[2]
    mask = silhouette(BODY, standing(), camera)
    pixels = np.rint(project_camera(markers(BODY, standing()), camera)).astype(int)
    inner = [n for n in MARKER_NAMES if n != "Head"]
    assert all(mask[v, u] for n, (u, v) in zip(MARKER_NAMES, pixels, strict=True) if n in inner)
