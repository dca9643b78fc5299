"""Silhouettes decided by the hull and the floor, where no body is known yet."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.camera import project_camera
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking.evidence.hull import find_hulls
from markerless_tracker.tracking.start.silhouettes import (
    components_in_hull,
    decided_by_hull,
    silhouettes_in_hull,
)


@pytest.fixture(scope="module")
def person():
    scene = SyntheticScene(body="person31", motion="walk", size_px=(256, 192), seed=4)
    _, masks, _ = scene.frame(0)
    masks = {name: mask > 0 for name, mask in masks.items()}
    hull = next(find_hulls(cameras(scene), {n: observe(n, m) for n, m in masks.items()}))
    return scene, masks, hull


def cameras(scene):
    return {camera.name: camera for camera in scene.rig}


def observe(name, mask, undecided=None) -> Observation:
    edges = np.zeros(mask.shape, np.uint8)
    person = mask if undecided is None else mask & ~undecided
    return Observation.from_mask(name, 0, person, edges, undecided=undecided)


def trunk_rows(mask):
    """(h, w): the rows of the trunk, whose rays meet the floor far behind the person if at all."""
    rows = np.flatnonzero(mask.any(axis=1))
    height = rows[-1] - rows[0]
    out = np.zeros_like(mask)
    out[rows[0] + height // 6 : rows[0] + height // 2] = True
    return out


def floor_disc(scene, name, mask, away_m):
    """(h, w): a disc of 0.2 m radius on the floor, so far from the person along x."""
    pelvis = scene.markers(0)[0]
    grid = np.stack(np.meshgrid(*[np.linspace(-0.2, 0.2, 200)] * 2), axis=-1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) < 0.2]
    points = np.column_stack([grid + pelvis[:2] + (away_m, 0.0), np.zeros(len(grid))])
    u, v = np.round(project_camera(points, scene.rig[name])).astype(int).T
    framed = (u >= 0) & (v >= 0) & (u < mask.shape[1]) & (v < mask.shape[0])
    disc = np.zeros_like(mask)
    disc[v[framed], u[framed]] = True
    return disc


def test_an_undecided_shirt_is_person(person) -> None:
    scene, masks, hull = person
    name = next(iter(masks))
    shirt = trunk_rows(masks[name]) & masks[name]
    seen = {n: observe(n, m, shirt if n == name else None) for n, m in masks.items()}
    decided = decided_by_hull(seen, cameras(scene), hull)
    assert decided[name].mask[shirt].mean() > 0.95
    assert decided[name].undecided[~shirt].sum() < 10
    # No other view has anything to decide.
    for other in masks:
        if other != name:
            assert (decided[other].mask != masks[other]).sum() < 10


def test_a_shadow_beside_the_hull_is_background(person) -> None:
    scene, masks, hull = person
    discs = {n: floor_disc(scene, n, m, 0.6) & ~m for n, m in masks.items()}
    seen = {n: observe(n, m | discs[n], discs[n]) for n, m in masks.items()}
    decided = decided_by_hull(seen, cameras(scene), hull)
    away = {n: disc & ~near(masks[n]) for n, disc in discs.items()}
    assert sum(disc.sum() for disc in away.values()) > 100
    for name, disc in away.items():
        assert not decided[name].not_background[disc].any()
        # Nothing of what is surely the person is lost but for the grid's spacing.
        assert decided[name].mask[masks[name]].mean() > 0.97


def test_a_shadow_at_the_feet_is_no_person(person) -> None:
    """All views show it: the hull reaches there, but no view sees its floor lit."""
    scene, masks, _ = person
    discs = {n: floor_disc(scene, n, m, 0.1) & ~m for n, m in masks.items()}
    seen = {n: observe(n, m | discs[n], discs[n]) for n, m in masks.items()}
    hull = next(find_hulls(cameras(scene), seen))
    decided = decided_by_hull(seen, cameras(scene), hull)
    shares = [decided[n].mask[disc].mean() for n, disc in discs.items()]
    assert np.mean(shares) < 0.25


def test_a_dark_shadow_beside_the_hull_is_undecided(person) -> None:
    """As person it is seen by all views; a hand that the hull lacks is not on the lit floor."""
    scene, masks, hull = person
    discs = {n: floor_disc(scene, n, m, 0.6) & ~m for n, m in masks.items()}
    name = next(iter(masks))
    hand = np.zeros_like(masks[name])
    hand[2:8, 2:8] = True
    speck = np.zeros_like(hand)
    speck[0, 0] = True
    seen = {n: observe(n, m | discs[n]) for n, m in masks.items()}
    seen[name] = observe(name, masks[name] | discs[name] | hand, speck)
    decided = decided_by_hull(seen, cameras(scene), hull)
    for n, disc in discs.items():
        away = disc & ~near(masks[n])
        assert decided[n].undecided[away].mean() > 0.9 if away.any() else True
    assert decided[name].mask[hand].all()


def test_silhouettes_without_undecided_pixels_stay(person) -> None:
    scene, masks, hull = person
    seen = {n: observe(n, m) for n, m in masks.items()}
    decided = silhouettes_in_hull(seen, cameras(scene), hull)
    assert all(decided[name] is seen[name] for name in seen)


def test_other_components_are_left_out(person) -> None:
    scene, masks, hull = person
    name = next(iter(masks))
    mask = masks[name].copy()
    mask[:8, :8] = True
    seen = observe(name, mask)
    kept = components_in_hull(seen, scene.rig[name], hull)
    assert not kept.mask[:8, :8].any()
    assert kept.mask.sum() == masks[name].sum()
    alone = replace(seen, mask_words=kept.mask_words)
    assert components_in_hull(alone, scene.rig[name], hull) is alone


def cut(mask, share):
    """A mask without four of its rows, at a share of its height, and the rows above them."""
    rows = np.flatnonzero(mask.any(axis=1))
    row = rows[0] + int(share * (rows[-1] - rows[0]))
    out = mask.copy()
    out[row : row + 4] = False
    return out, np.arange(len(mask))[:, None] < row


@pytest.mark.parametrize(
    ("share", "stays"),
    [
        pytest.param(0.14, True, id="head"),
        # As large as another person, farther away.
        pytest.param(0.5, False, id="upper-half"),
    ],
)
def test_a_small_part_that_another_view_does_not_show_stays(person, share, stays) -> None:
    """One view carves it from the hull; in the others a gap separates it."""
    scene, masks, _ = person
    first, *others = masks
    parts = {name: cut(mask, share) for name, mask in masks.items()}
    seen = {name: observe(name, part) for name, (part, _) in parts.items()}
    seen[first] = observe(first, parts[first][0] & ~parts[first][1])
    hull = next(find_hulls(cameras(scene), seen))
    assert hull.high_m < scene.markers(0)[:, 2].max() - 0.1
    for name in others:
        above = parts[name][0] & parts[name][1]
        assert above.any()
        assert components_in_hull(seen[name], scene.rig[name], hull).mask[above].all() == stays


def near(mask, px=6):
    """(h, w): the pixels within a square about those of a mask."""
    rows, columns = np.nonzero(mask)
    out = np.zeros_like(mask)
    for row, column in zip(rows, columns, strict=True):
        out[max(0, row - px) : row + px + 1, max(0, column - px) : column + px + 1] = True
    return out
