"""The visual hull where pixels are undecided: legs like the floor, and shadows on it."""

from itertools import permutations

import numpy as np
import pytest

from markerless_tracker.body import markers
from markerless_tracker.camera import project_camera
from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.grid import FINE_M, SHADOW_HEIGHT_M
from markerless_tracker.tracking.evidence.hull import FLAT_M, FOOT_M, SHIN_M, find_hulls


@pytest.fixture(scope="module")
def person():
    scene = SyntheticScene(body="person31", motion="walk", size_px=(256, 192), seed=4)
    _, masks, _ = scene.frame(0)
    return scene, {name: mask > 0 for name, mask in masks.items()}


def cameras(scene):
    return {camera.name: camera for camera in scene.rig}


def observe(name, mask, undecided) -> Observation:
    edges = np.zeros(mask.shape, np.uint8)
    return Observation.from_mask(name, 0, mask & ~undecided, edges, undecided=undecided)


def lower_half(mask):
    rows = np.flatnonzero(mask.any(axis=1))
    half = np.zeros_like(mask)
    half[(rows[0] + rows[-1]) // 2 :] = True
    return half


def floor_disc(scene, name, mask):
    """(h, w): the pixels of a disc of 0.3 m radius on the floor beside the person."""
    pelvis = scene.markers(0)[0]
    grid = np.stack(np.meshgrid(*[np.linspace(-0.3, 0.3, 240)] * 2), axis=-1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) < 0.3]
    points = np.column_stack([grid + pelvis[:2] + (0.22, 0.0), np.zeros(len(grid))])
    u, v = np.round(project_camera(points, scene.rig[name])).astype(int).T
    height, width = mask.shape
    framed = (u >= 0) & (v >= 0) & (u < width) & (v < height)
    disc = np.zeros_like(mask)
    disc[v[framed], u[framed]] = True
    return disc


def with_shadow(scene, masks, points):
    """Observations in which points (n, 3) of the room are undecided beside the person."""
    seen = {}
    for name, mask in masks.items():
        u, v = np.round(project_camera(points, scene.rig[name])).astype(int).T
        framed = (u >= 0) & (v >= 0) & (u < mask.shape[1]) & (v < mask.shape[0])
        shadow = np.zeros_like(mask)
        shadow[v[framed], u[framed]] = True
        seen[name] = observe(name, mask | shadow, shadow & ~mask)
    return seen


def test_undecided_legs_in_two_views_do_not_carve(person) -> None:
    scene, masks = person
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    whole = next(find_hulls(cameras(scene), {n: observe(n, masks[n], nothing[n]) for n in masks}))
    two = list(masks)[:2]
    hidden = {n: lower_half(m) & m if n in two else nothing[n] for n, m in masks.items()}
    seen = {n: observe(n, masks[n], hidden[n]) for n in masks}
    hull = next(find_hulls(cameras(scene), seen))
    assert abs(hull.low_m - whole.low_m) < 0.07 and abs(hull.high_m - whole.high_m) < 0.04
    # As background they would carve the legs away.
    carved = {n: observe(n, masks[n] & ~hidden[n], nothing[n]) for n in masks}
    assert next(find_hulls(cameras(scene), carved)).low_m > whole.low_m + 0.3


def test_a_shadow_on_the_floor_adds_nothing_above_it(person) -> None:
    """Its layer at the floor, as thick as the masks are grown, does not move the trunk."""
    scene, masks = person
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    discs = {n: floor_disc(scene, n, m) & ~m for n, m in masks.items()}
    assert all(disc.sum() > 20 for disc in discs.values())
    plain, shadowed = (
        next(find_hulls(cameras(scene), {n: observe(n, masks[n] | u[n], u[n]) for n in masks}))
        for u in (nothing, discs)
    )
    above = [int((hull.points_m[:, 2] > SHADOW_HEIGHT_M + 0.1).sum()) for hull in (plain, shadowed)]
    assert above[1] == pytest.approx(above[0], rel=0.02)
    trunks = [hull.trunk_m.mean(axis=0) for hull in (plain, shadowed)]
    assert np.linalg.norm(trunks[0] - trunks[1]) < 0.03
    assert abs(plain.high_m - shadowed.high_m) < 0.04
    # As person it reaches down to the floor and below.
    as_person = {n: observe(n, masks[n] | discs[n], nothing[n]) for n in masks}
    hull = next(find_hulls(cameras(scene), as_person))
    assert len(hull.points_m) > 1.05 * len(shadowed.points_m)


def test_a_shadow_without_a_person_is_no_hull(person) -> None:
    scene, masks = person
    seen = {}
    for name, mask in masks.items():
        speck = np.zeros_like(mask)
        speck[0, 0] = True
        seen[name] = observe(name, speck, floor_disc(scene, name, mask))
    assert not list(find_hulls(cameras(scene), seen))


@pytest.mark.parametrize(
    ("gap_m", "size_m", "low_m"),
    [
        pytest.param(0.1, (2.0, 0.2, 0.5), 0.1, id="near"),
        pytest.param(0.0, (2.5, 0.6, 0.3), 0.8, id="touches"),
    ],
)
def test_a_larger_shadow_does_not_hide_the_person(person, gap_m, size_m, low_m) -> None:
    """A wall of undecided points that reaches far aside, of more volume than the person."""
    scene, masks = person
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    plain = next(find_hulls(cameras(scene), {n: observe(n, masks[n], nothing[n]) for n in masks}))
    side = float(plain.points_m[:, 0].max())
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 80)] * 3), axis=-1).reshape(-1, 3)
    corner = [side + gap_m, scene.markers(0)[0][1] - 0.5 * size_m[1], low_m]
    hull = next(find_hulls(cameras(scene), with_shadow(scene, masks, corner + grid * size_m)))
    assert np.linalg.norm((hull.trunk_m.mean(axis=0) - plain.trunk_m.mean(axis=0))[:2]) < 0.2
    assert hull.points_m[:, 0].max() < side + 0.5 * size_m[0]


def test_a_shadow_beside_the_person_is_left_out(person) -> None:
    """A patch that all views show as undecided, 0.7 m aside of the person and up to the shins."""
    scene, masks = person
    pelvis = scene.markers(0)[0]
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 60)] * 3), axis=-1).reshape(-1, 3)
    patch = pelvis * [1.0, 1.0, 0.0] + [0.45, 0.0, 0.12] + grid * [0.45, 0.15, 0.12]
    seen = with_shadow(scene, masks, patch)
    hull = next(find_hulls(cameras(scene), seen))
    aside = hull.points_m[:, 0] - hull.trunk_m[:, 0].mean() > 0.6
    assert not aside.any()
    assert np.linalg.norm(hull.trunk_m.mean(axis=0)[:2] - pelvis[:2]) < 0.2
    assert SHIN_M < hull.sure_m[:, 2].min() < 0.2 and len(hull.sure_m) < len(hull.points_m)


def test_the_floor_far_from_the_legs_is_no_foot(person) -> None:
    """A dark shadow, person in all views, lies at the floor: beside the feet it is no hull."""
    scene, masks = person
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    discs = {n: floor_disc(scene, n, m) for n, m in masks.items()}
    hull = next(
        find_hulls(cameras(scene), {n: observe(n, masks[n] | discs[n], nothing[n]) for n in masks})
    )
    plain = next(
        find_hulls(cameras(scene), {n: observe(n, m, nothing[n]) for n, m in masks.items()})
    )
    middle = scene.markers(0)[0] + (0.22, 0.0, 0.0)
    far = np.linalg.norm(hull.points_m[:, :2] - middle[:2], axis=1) < 0.3
    legs = plain.points_m[(plain.points_m[:, 2] > SHIN_M) & (plain.points_m[:, 2] < 0.3)]
    gaps = np.linalg.norm(hull.points_m[far][:, None, :2] - legs[None, :, :2], axis=2).min(axis=1)
    assert gaps[hull.points_m[far, 2] < SHIN_M].max() < FOOT_M + 2 * FINE_M
    # The feet stay.
    assert hull.low_m < plain.low_m + 0.04


def floor_patch(scene, masks, away_m, size_m):
    """(h, w) per view: a patch of the floor beside the person, along x."""
    pelvis = scene.markers(0)[0]
    low = (pelvis[0] + away_m, pelvis[1] - 0.5 * size_m, -0.001)
    high = (low[0] + size_m, low[1] + size_m, 0.001)
    return {n: box_pixels(scene.rig[n], low, high, m.shape) for n, m in masks.items()}


def test_a_dark_shadow_is_nobody(person) -> None:
    """A patch of the floor that all views show as person has a hull as thick as masks are grown."""
    scene, masks = person
    patch = floor_patch(scene, masks, 0.0, 0.9)
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    assert not list(
        find_hulls(cameras(scene), {n: observe(n, patch[n], nothing[n]) for n in masks})
    )


def test_a_dark_shadow_does_not_hide_the_person(person) -> None:
    """Legs without silhouettes separate it from the person, of whom it has more points."""
    scene, masks = person
    patch = floor_patch(scene, masks, -0.45, 0.9)
    nothing = {name: np.zeros_like(mask) for name, mask in masks.items()}
    upper = {name: mask & ~lower_half(mask) for name, mask in masks.items()}
    seen = {n: observe(n, upper[n] | patch[n], nothing[n]) for n in masks}
    hull = next(find_hulls(cameras(scene), seen))
    assert np.linalg.norm(hull.trunk_m.mean(axis=0) - scene.markers(0)[:2].mean(axis=0)) < 0.25


def test_a_person_who_lies_is_found() -> None:
    scene = SyntheticScene(body="person31", size_px=(256, 192), seed=4)
    pose = scene.body.neutral.copy()
    pose[scene.body.root_position] = (0.0, 0.0, 0.11)
    pose[scene.body.index("pelvis_ry")] = 0.5 * np.pi
    nothing = np.zeros((192, 256), dtype=np.bool_)
    masks = {c.name: silhouette(scene.body, pose, c) > 0 for c in scene.rig}
    seen = {name: observe(name, mask, nothing) for name, mask in masks.items()}
    hull = next(find_hulls(cameras(scene), seen))
    assert hull.height_m < FLAT_M
    trunk_m = markers(scene.body, pose)[:2].mean(axis=0)
    assert np.linalg.norm((hull.trunk_m.mean(axis=0) - trunk_m)[:2]) < 0.4


def box_pixels(camera, low_m, high_m, shape):
    """(h, w): pixels of a grid of points in a box."""
    axes = [np.linspace(low, high, 24) for low, high in zip(low_m, high_m, strict=True)]
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)
    columns, rows = np.round(project_camera(points, camera)).astype(int).T
    seen = (columns >= 0) & (rows >= 0) & (columns < shape[1]) & (rows < shape[0])
    mask = np.zeros(shape, dtype=np.bool_)
    mask[rows[seen], columns[seen]] = True
    return mask


def test_the_order_of_the_cameras_does_not_matter(person) -> None:
    """Two cameras see a thing beside the person that the other two see as background."""
    scene, masks = person
    middle = scene.markers(0).mean(axis=0)
    seen = {}
    for camera in scene.rig:
        shape = masks[camera.name].shape
        shadow = box_pixels(camera, middle - (0.66, 0.58, 0.25), middle + (0.86, 0.27, 0.20), shape)
        mask = masks[camera.name]
        if camera.name in (scene.rig.names[1], scene.rig.names[3]):
            mask = mask | box_pixels(
                camera, middle + (-0.27, 0.45, 0.30), middle + (0.29, 0.98, 0.56), shape
            )
        seen[camera.name] = observe(camera.name, mask, shadow & ~mask)
    found = set()
    for names in permutations(seen):
        hulls = find_hulls(cameras(scene), {name: seen[name] for name in names})
        # The grid's place differs by rounding.
        found.add(tuple(np.round(hull.points_m, 6).tobytes() for hull in hulls))
    assert len(found) == 1
