"""The visual hull: the position of a person."""

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import project_camera
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.hull import find_hulls


@pytest.fixture(scope="module")
def person():
    scene = SyntheticScene(body="person31", motion="walk", size_px=(256, 192), seed=4)
    _, masks, pose = scene.frame(0)
    return scene, masks, pose


def observed(masks):
    return {
        name: Observation.from_mask(name, 0, mask, np.zeros(mask.shape, np.uint8))
        for name, mask in masks.items()
    }


def cameras(scene):
    return {camera.name: camera for camera in scene.rig}


def test_the_hull_holds_the_person_and_little_else(person) -> None:
    scene, masks, _ = person
    hull, *others = find_hulls(cameras(scene), observed(masks))
    assert not others
    points = scene.markers(0)
    gaps = np.linalg.norm(hull.points_m[:, None] - points[None], axis=2).min(axis=0)
    assert gaps.max() < 0.06
    assert abs(hull.high_m - points[2, 2]) < 0.06
    assert abs(hull.low_m) < 0.08
    pelvis, neck = points[0], points[1]
    assert np.linalg.norm(hull.trunk_m.mean(axis=0) - 0.5 * (pelvis + neck)) < 0.12


def test_two_views_are_enough_and_one_is_not(person) -> None:
    scene, masks, _ = person
    seen = observed(masks)
    two = dict(list(seen.items())[:2])
    (hull,) = find_hulls(cameras(scene), two)
    assert np.linalg.norm(hull.trunk_m.mean(axis=0)[:2] - scene.markers(0)[0, :2]) < 0.2
    assert not list(find_hulls(cameras(scene), dict(list(seen.items())[:1])))


def test_nobody(person) -> None:
    scene, masks, _ = person
    empty = {name: np.zeros_like(mask) for name, mask in masks.items()}
    assert not list(find_hulls(cameras(scene), observed(empty)))


def test_a_thing_of_a_hands_size_is_nobody(person) -> None:
    scene, masks, _ = person
    specks = {}
    for camera in scene.rig:
        mask = np.zeros_like(masks[camera.name])
        u, v = np.array(mask.shape[::-1]) // 2
        mask[v - 3 : v + 4, u - 3 : u + 4] = 1
        specks[camera.name] = mask
    assert not list(find_hulls(cameras(scene), observed(specks)))


def test_a_view_that_shows_nothing_does_not_hide_the_person(person) -> None:
    scene, masks, _ = person
    seen = observed(masks)
    name = next(iter(seen))
    seen[name] = observed({name: np.zeros_like(masks[name])})[name]
    assert len(list(find_hulls(cameras(scene), seen))) == 1


def test_a_hull_in_pieces_is_one_person(person) -> None:
    """In one view clothes of the room's colour leave a gap between legs and chest."""
    scene, masks, _ = person
    pelvis, neck = scene.markers(0)[:2]
    for camera in scene.rig:
        mask = masks[camera.name].copy()
        waist = np.array([pelvis, pelvis + 0.5 * (neck - pelvis)])
        low, high = project_camera(waist, camera)[:, 1]
        mask[int(high) : int(low)] = 0
        (hull,) = find_hulls(cameras(scene), observed({**masks, camera.name: mask}))
        assert abs(hull.high_m - scene.markers(0)[2, 2]) < 0.06 and abs(hull.low_m) < 0.08


def test_what_two_cameras_see_is_not_the_person(person) -> None:
    """Two of four cameras see a pillar larger than the person; shadows lead from one to the other.

    The shadows are spots, which connect both on the room's grid, and not on the fine one.
    """
    scene, masks, _ = person
    pelvis, pillar = scene.markers(0)[0], np.array([1.7, -2.3, 1.0])
    turn = np.linspace(0.0, 2.0 * np.pi, 12)
    ring = 0.16 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(12)])
    ends = np.concatenate([pillar + ring + (0.0, 0.0, up) for up in (-0.6, 0.6)])
    aside = 0.15 * np.stack(np.meshgrid(*3 * [(-1, 0, 1)]), axis=-1).reshape(-1, 3)
    spots = (np.linspace(pelvis, pillar, 14)[:, None] + aside).reshape(-1, 3)
    seen = {}
    for camera in scene.rig:
        mask = masks[camera.name].astype(np.uint8)
        if camera.name in scene.rig.names[1::2]:
            corners = np.round(project_camera(ends, camera)).astype(np.int32)
            cv2.fillConvexPoly(mask, cv2.convexHull(corners), 1)
        undecided = np.zeros_like(mask)
        for u, v in np.round(project_camera(spots, camera)).astype(int):
            if 0 <= u < mask.shape[1] and 0 <= v < mask.shape[0] and not mask[v, u]:
                undecided[v, u] = 1
        edges = np.zeros_like(mask)
        seen[camera.name] = Observation.from_mask(camera.name, 0, mask, edges, undecided=undecided)
    hull = next(find_hulls(cameras(scene), seen))
    assert np.linalg.norm((hull.trunk_m.mean(axis=0) - pelvis)[:2]) < 0.3
