"""Points on the model's outline: on it, all along it, facing outward, at their world points."""

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from markerless_tracker.body import Subject, cone_transforms, load_body, load_description
from markerless_tracker.camera import project_camera
from markerless_tracker.drawing import outlines, silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)
STEP_PX = 2.0
SEAM_PX = STEP_PX + 2.0
"""How deep in a neighbouring part a sample may lie: the free step, and the kernel's coarse ends."""


def boundary(mask) -> FloatArray:
    """Points (n, 2) midway between neighbouring pixels inside and outside a mask."""
    across = np.argwhere(mask[:, 1:] != mask[:, :-1])[:, ::-1] + [0.5, 0.0]
    down = np.argwhere(mask[1:] != mask[:-1])[:, ::-1] + [0.0, 0.5]
    return np.concatenate([across, down])


def at_pixels(mask, points):
    """The mask's values at points (n, 2); the frame's nearest pixel outside it."""
    at = np.clip(np.rint(points).astype(int), 0, np.array(mask.shape[::-1]) - 1)
    return mask[at[:, 1], at[:, 0]]


def free_length(polygons, size) -> float:
    """Length (px) of the outlines' pieces within a frame and outside all other polygons."""
    total = 0.0
    for i, polygon in enumerate(polygons):
        following = np.roll(polygon, -1, axis=0)
        step = np.linalg.norm(following - polygon, axis=1)
        parts = np.maximum(1, np.ceil(step / 0.5).astype(int))
        t = np.concatenate([(np.arange(n) + 0.5) / n for n in parts])
        a, b = np.repeat(polygon, parts, axis=0), np.repeat(following, parts, axis=0)
        points = a + t[:, None] * (b - a)
        free = (points >= 0).all(axis=1) & (points <= np.array(size) - 1).all(axis=1)
        for j, other in enumerate(polygons):
            if i == j:
                continue
            hull = other.astype(np.float32).reshape(-1, 1, 2)
            near = free & (points > other.min(axis=0)).all(axis=1)
            near &= (points < other.max(axis=0)).all(axis=1)
            for n in np.flatnonzero(near):
                free[n] = cv2.pointPolygonTest(hull, tuple(map(float, points[n])), False) < 0
        total += float(np.repeat(step / parts, parts)[free].sum())
    return total


def test_samples_lie_on_the_outline_and_cover_it(posed) -> None:
    """All but a few near joints, which may hide in a neighbouring part up to the free step."""
    for v, camera in enumerate(posed.rig):
        mask = posed.observations[camera.name].mask
        samples = posed.frame.samples
        pixels = samples.pixel[v, : samples.count[v]]
        outline = boundary(mask)
        off = cKDTree(outline).query(pixels)[0]
        assert (off <= 1.0).mean() >= 0.94
        # Nothing on the seams between the body's own parts.
        assert off.max() <= SEAM_PX
        gap = cKDTree(pixels).query(outline)[0]
        assert (gap <= 2.0 * posed.spacing_px).mean() >= 0.98
        # Between legs that nearly touch, the free step ends in the other leg.
        truncation = np.ones((2 * int(STEP_PX) + 3,) * 2, np.uint8)
        filled = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, truncation)
        near_gap = cv2.dilate(filled - mask.view(np.uint8), truncation)
        column, row = np.round(outline).astype(int).T
        assert gap[near_gap[row, column] == 0].max() <= 4.0 * posed.spacing_px


def test_normals_point_out_of_the_body(posed) -> None:
    for v, camera in enumerate(posed.rig):
        mask = posed.observations[camera.name].mask
        n = posed.frame.samples.count[v]
        pixels, normals = posed.frame.samples.pixel[v, :n], posed.frame.samples.normal[v, :n]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
        assert at_pixels(mask, pixels + STEP_PX * normals).mean() <= 0.02
        assert at_pixels(mask, pixels - STEP_PX * normals).mean() >= 0.98


def test_samples_lie_on_their_cones_outline_at_right_angles(posed) -> None:
    for v, camera in enumerate(posed.rig):
        samples = posed.frame.samples
        polygons = outlines(posed.body, posed.pose, camera)
        turned = []
        for s in range(samples.count[v]):
            p, polygon = samples.pixel[v, s], polygons[samples.cone[v, s]]
            d = np.roll(polygon, -1, axis=0) - polygon
            t = np.clip(((p - polygon) * d).sum(axis=1) / (d * d).sum(axis=1), 0.0, 1.0)
            away = np.linalg.norm(polygon + t[:, None] * d - p, axis=1)
            side = int(away.argmin())
            # A polygon's sides cut the round ends; tapered cones have the widest ones.
            assert away[side] < 0.06
            normal = np.array([d[side, 1], -d[side, 0]]) / np.linalg.norm(d[side])
            if normal @ (p - polygon.mean(axis=0)) < 0:
                normal = -normal
            turned.append(normal @ samples.normal[v, s])
        # The polygon's corners are rounder than the flattest ends.
        assert np.min(turned) > 0.6 and np.quantile(turned, 0.05) > 0.98


def test_world_points_project_onto_their_pixels(posed) -> None:
    for v, camera in enumerate(posed.rig):
        n = posed.frame.samples.count[v]
        world = posed.frame.samples.world[v, :n]
        np.testing.assert_allclose(
            project_camera(world, camera), posed.frame.samples.pixel[v, :n], atol=1e-9
        )
        depth = world @ camera.T_cam_world[2, :3] + camera.T_cam_world[2, 3]
        np.testing.assert_allclose(posed.frame.samples.depth[v, :n], depth)


def test_the_place_on_the_cone_gives_the_world_point(posed) -> None:
    """cos and sin on both ends' ellipses and the fraction of end 1."""
    placed = cone_transforms(posed.body, posed.pose)
    samples = posed.frame.samples
    for v in range(len(posed.rig)):
        for s in range(0, samples.count[v], 3):
            c = samples.cone[v, s]
            *turns, t = samples.place[v, s]
            ends = []
            for e in range(2):
                rx, ry, ox, oy = posed.body.cone_shape[c, e]
                cos, sin = turns[2 * e : 2 * e + 2]
                assert cos**2 + sin**2 == pytest.approx(1.0)
                z = e * posed.body.cone_length[c]
                ends.append(np.array([ox + rx * cos, oy + ry * sin, z]))
            local = (1.0 - t) * ends[0] + t * ends[1]
            expected = placed[c, :, :3] @ local + placed[c, :, 3]
            np.testing.assert_allclose(samples.world[v, s], expected, atol=1e-12)


def test_lengths_add_up_to_the_outline(posed) -> None:
    """The represented length, in px: the whole free outline apart from the corners.

    Where two cones' outlines run along each other, less than the free step apart, both count.
    """
    most = 1.05 if posed.body.name == "balan31" else 1.20
    for v, camera in enumerate(posed.rig):
        samples = posed.frame.samples
        n = samples.count[v]
        px = samples.length[v, :n] * camera.matrix[0, 0] / samples.depth[v, :n]
        assert px.max() <= 1.4 * posed.spacing_px
        whole = free_length(outlines(posed.body, posed.pose, camera), camera.size_px)
        assert 0.95 * whole <= px.sum() <= most * whole


def test_samples_along_a_side_are_evenly_spaced_in_the_image(make_pose, make_scene) -> None:
    """Also where a limb points at the camera, and steps along it are not."""
    made = make_scene("person31", 4, make_pose)
    made.frame.collect(made.pose, 0.1)
    samples, compared, uneven = made.frame.samples, 0, 0.0
    for v in range(len(made.rig)):
        n = samples.count[v]
        for c in range(len(made.body.cone_names)):
            (mine,) = np.nonzero(samples.cone[v, :n] == c)
            for side in np.unique(samples.place[v, mine, :4], axis=0):
                on = mine[(samples.place[v, mine, :4] == side).all(axis=1)]
                if on.size < 4:
                    continue
                gap = np.linalg.norm(np.diff(samples.pixel[v, on], axis=0), axis=1)
                # Points that other parts hide are missing.
                steps = gap / gap.min()
                np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
                compared += on.size
                along = np.diff(samples.place[v, on, 4]) / np.rint(steps)
                uneven = max(uneven, np.ptp(along) / along.mean())
    assert compared > 500 and uneven > 0.02


def test_parts_outside_the_frame_have_no_samples(make_pose, make_scene) -> None:
    made = make_scene("person31", 5, make_pose, lens=LENS)
    pose = made.body.neutral.copy()
    pose[made.body.index("pelvis_tz")] = -0.3
    made.frame.collect(pose, 0.1)
    samples = made.frame.samples
    for v, camera in enumerate(made.rig):
        pixels = samples.pixel[v, : samples.count[v]]
        assert samples.count[v] > 50
        assert (pixels >= 0).all() and (pixels <= np.array(camera.size_px) - 1).all()
        cut = silhouette(made.body, pose, camera)
        assert cut[-1].any()
        # What lies outside the frame is not drawn and hides nothing.
        border = (pixels < STEP_PX).any(axis=1)
        border |= (pixels > np.array(camera.size_px) - 1 - STEP_PX).any(axis=1)
        assert border.mean() < 0.05
        assert cKDTree(boundary(cut)).query(pixels[~border])[0].max() <= SEAM_PX


def test_a_body_behind_a_camera_has_no_samples_there(make_pose, make_scene) -> None:
    made = make_scene("person31", 6, make_pose)
    pose = made.pose.copy()
    eye = made.rig.cameras[0].T_world_cam
    pose[[made.body.index(f"pelvis_t{a}") for a in "xyz"]] = eye[:3, 3] - 2.0 * eye[:3, 2]
    made.frame.equations(pose, 0.1)
    assert made.frame.samples.count[0] == 0
    assert np.isfinite(made.frame.equations(pose, 0.1).cost)


def test_more_samples_than_fit() -> None:
    """A giant: further samples are dropped, and nothing is written out of bounds."""
    description = load_description("person31")
    body = load_body("person31", Subject("giant", dict.fromkeys(description.lengths, 2.9)))
    (camera,) = rig = ring_rig(1, (2400, 1800), distance_m=30.0, distortion=(0.0,) * 5)
    nothing = np.zeros((1800, 2400), np.uint8)
    blank = {camera.name: Observation.from_mask(camera.name, 0, nothing, nothing)}
    views = Fitness(body, rig.cameras).lay_out(blank)
    frame = ContourFrame(body, {camera.name: camera}, blank, views, pixels_per_m={camera.name: 80})
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    pose[body.index("l_shoulder_y")] += 1.2
    found = frame.equations(pose, 0.1)
    assert frame.samples.count[0] == MAX_SAMPLES
    assert np.isfinite(found.cost) and np.isfinite(frame.samples.world[0]).all()
