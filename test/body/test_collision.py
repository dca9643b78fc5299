"""Joint limits and collision rules."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import Feasibility, cone_transforms, load_body
from markerless_tracker.body.collision import MARGIN_M, fill_with_spheres
from markerless_tracker.errors import ConfigError

BODY = load_body("balan31")
FREE = np.tile([[-np.inf], [np.inf]], (1, BODY.size))


def cone(name):
    return BODY.cone_names.index(name)


# --- spheres ---------------------------------------------------------------------------------


def with_cone(length, *ends):
    """The body with its torso replaced by a cone of that length and those ends."""
    lengths, shapes = BODY.cone_length.copy(), BODY.cone_shape.copy()
    lengths[cone("torso")], shapes[cone("torso")] = length, ends
    return dataclasses.replace(BODY, cone_length=lengths, cone_shape=shapes)


def spheres_of(body, name):
    spheres = fill_with_spheres(body)
    i = body.cone_names.index(name)
    part = slice(spheres.first[i], spheres.first[i + 1])
    return spheres.centre[part], spheres.radius[part]


def test_spheres_of_a_straight_cone_of_known_sizes() -> None:
    # round(0.9 / 0.1 / 2) = round(4.5) = 4, five spheres; the flat section (0.05) is ignored.
    centre, radius = spheres_of(with_cone(0.9, [0.05, 0.1, 0, 0], [0.05, 0.1, 0, 0]), "torso")
    np.testing.assert_allclose(centre, [[0, 0, z] for z in (0, 0.225, 0.45, 0.675, 0.9)])
    np.testing.assert_allclose(radius, 0.1)


def test_spheres_of_a_tapered_leaning_cone_of_known_sizes() -> None:
    # round(0.4 / 0.1 / 2) = 2, three spheres; radii shrink by sqrt(1 + (0.03 / 0.4)²).
    body = with_cone(0.4, [0.1, 0.1, 0, 0], [0.07, 0.07, 0.02, -0.04])
    centre, radius = spheres_of(body, "torso")
    np.testing.assert_allclose(centre, [[0, 0, 0], [0.01, -0.02, 0.2], [0.02, -0.04, 0.4]])
    np.testing.assert_allclose(radius, np.array([0.1, 0.085, 0.07]) / np.sqrt(1 + 0.075**2))


@pytest.mark.parametrize(("length", "count"), [(0.1, 2), (0.5, 3), (100.0, 21)])
def test_at_least_two_spheres_and_at_most_twenty_one(length, count) -> None:
    _, radius = spheres_of(with_cone(length, [0.1, 0.1, 0, 0], [0.1, 0.1, 0, 0]), "torso")
    assert len(radius) == count


# --- the rules against slow twins ------------------------------------------------------------


def world_spheres(body, pose, name):
    centre, radius = spheres_of(body, name)
    T = cone_transforms(body, pose)[body.cone_names.index(name)]
    return centre @ T[:, :3].T + T[:, 3], radius


def slow_published(body, pose):
    """No sphere of one cone of a pair overlaps one of the other."""
    for a, b in body.collisions:
        ca, ra = world_spheres(body, pose, body.cone_names[a])
        cb, rb = world_spheres(body, pose, body.cone_names[b])
        gap = np.linalg.norm(ca[:, None] - cb[None], axis=2)
        if (gap < ra[:, None] + rb[None]).any():
            return False
    return True


def slow_elliptic(body, pose):
    """No sphere of the first cone reaches the second's elliptic section, both being shrunk."""
    for a, b in body.collisions:
        centres, radii = world_spheres(body, pose, body.cone_names[a])
        T = cone_transforms(body, pose)[b]
        length, shape = body.cone_length[b], body.cone_shape[b]
        for centre, radius in zip(centres, radii, strict=True):
            x, y, z = T[:, :3].T @ (centre - T[:, 3])
            grow = radius - 2 * MARGIN_M
            if not -grow <= z <= length + grow:
                continue
            rx, ry, ox, oy = np.array([1 - (t := np.clip(z / length, 0, 1)), t]) @ shape
            rx, ry = rx + grow, ry + grow
            if rx > 0 and ry > 0 and ((x - ox) / rx) ** 2 + ((y - oy) / ry) ** 2 < 1:
                return False
    return True


def crowded_poses(seed, count):
    """Poses whose forearms and calves lie near what they must not enter."""
    rng = np.random.default_rng(seed)
    return BODY.neutral + rng.uniform(-0.7, 0.7, (count, BODY.size))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
@pytest.mark.parametrize(
    ("rule", "twin"), [("published", slow_published), ("elliptic", slow_elliptic)]
)
def test_rules_agree_with_numpy_references(rule, twin, seed) -> None:
    poses = crowded_poses(seed, 8)
    expected = [twin(BODY, pose) for pose in poses]
    np.testing.assert_array_equal(Feasibility(BODY, FREE, rule)(poses), expected)


def test_the_rules_differ_on_crowded_poses() -> None:
    """Otherwise the comparison with the twins would prove nothing."""
    poses = crowded_poses(0, 400)
    shares = {r: Feasibility(BODY, FREE, r)(poses).mean() for r in ("published", "elliptic")}
    assert 0.05 < shares["published"] < shares["elliptic"] < 0.95
    assert Feasibility(BODY, FREE, "none")(poses).all()


# --- constructed cases -----------------------------------------------------------------------


def beside_torso(x, y):
    """A forearm upright at (x, y) of a torso with radii 0.10 (x) and 0.20 (y), and the verdicts."""
    lengths, shapes = BODY.cone_length.copy(), BODY.cone_shape.copy()
    lengths[cone("torso")] = 0.9
    shapes[cone("torso")] = [[0.1, 0.2, 0, 0]] * 2
    lengths[cone("l_forearm")] = 0.24
    shapes[cone("l_forearm")] = [[0.04, 0.04, 0, 0]] * 2
    fixed = BODY.cone_fixed.copy()
    fixed[cone("l_forearm")] = np.column_stack([np.eye(3), [x, y, 0.37]])
    node = BODY.cone_node.copy()
    node[cone("l_forearm")] = node[cone("torso")]
    body = dataclasses.replace(
        BODY, cone_length=lengths, cone_shape=shapes, cone_fixed=fixed, cone_node=node,
        collisions=np.array([[cone("l_forearm"), cone("torso")]]),
    )  # fmt: skip
    return {rule: bool(Feasibility(body, FREE, rule)(BODY.neutral[None])[0])
            for rule in ("elliptic", "published")}  # fmt: skip


@pytest.mark.parametrize(
    ("x", "y", "elliptic", "published"),
    [
        (0.00, 0.00, False, False),
        # In front, the flat section ends at 0.10: + 0.04 - 2 * 0.03 = 0.08.
        (0.079, 0.0, False, False),
        (0.081, 0.0, True, False),
        # The published spheres have radius 0.20: they leave at 0.24.
        (0.239, 0.0, True, False),
        (0.241, 0.0, True, True),
        # At the side, 0.20 + 0.04 - 0.06 = 0.18.
        (0.0, 0.179, False, False),
        (0.0, 0.181, True, False),
        (0.0, -0.181, True, False),
        (0.0, 0.241, True, True),
    ],
)
def test_a_forearm_beside_the_torso(x, y, elliptic, published) -> None:
    assert beside_torso(x, y) == {"elliptic": elliptic, "published": published}


# --- limits ----------------------------------------------------------------------------------


def test_limits_are_kept_including_the_ends() -> None:
    poses = np.tile(BODY.neutral, (4, 1))
    knee = BODY.index("l_knee")
    low, high = BODY.limits[:, knee]
    poses[:, knee] = low, high, np.nextafter(low, -9), np.nextafter(high, 9)
    mask = Feasibility(BODY, BODY.limits, "none")(poses)
    assert mask.tolist() == [True, True, False, False]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_poses_that_are_not_finite_are_infeasible(value) -> None:
    pose = BODY.neutral.copy()
    pose[BODY.index("l_elbow")] = value
    assert not Feasibility(BODY, BODY.limits, "elliptic")(pose[None]).any()


def test_no_poses() -> None:
    assert Feasibility(BODY, BODY.limits, "elliptic")(np.empty((0, BODY.size))).shape == (0,)


def test_unknown_rule() -> None:
    with pytest.raises(ConfigError, match="collision is 'soft', expected one of elliptic, pub"):
        Feasibility(BODY, BODY.limits, "soft")


@settings(deadline=None, max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(sorted(BODY.subspaces)),
    st.sampled_from(["elliptic", "published", "none"]),
)
def test_points_around_a_centre_are_tested_like_whole_poses(seed, part, rule) -> None:
    rng = np.random.default_rng(seed)
    centre = BODY.neutral + rng.choice([0.0, 0.3]) * rng.standard_normal(BODY.size)
    active = BODY.subspaces[part]
    feasible = Feasibility(BODY, BODY.limits, rule)
    points = centre[active] + 0.5 * rng.standard_normal((20, active.size))
    poses = np.tile(centre, (20, 1))
    poses[:, active] = points
    np.testing.assert_array_equal(feasible.around(active, centre)(points), feasible(poses))


def test_a_pair_that_inter_penetrates_at_the_centre_may_be_ignored() -> None:
    """An arm inside the belly, as images have it: it may stay there, the other arm may not go."""
    rng = np.random.default_rng(1)
    feasible = Feasibility(BODY, BODY.limits, "elliptic")
    poses = BODY.neutral + 0.5 * rng.standard_normal((4000, BODY.size))
    poses = np.clip(poses, *np.where(np.isfinite(BODY.limits), BODY.limits, [[-1.0], [1.0]]))
    pairs = {}
    for k, pair in enumerate(BODY.collisions):
        alone = dataclasses.replace(BODY, collisions=BODY.collisions[k : k + 1])
        pairs[tuple(pair)] = ~Feasibility(alone, BODY.limits, "elliptic")(poses)
    left = [pair for pair in pairs if BODY.cone_names[pair[0]].startswith("l_f")][0]
    others = np.any([hit for pair, hit in pairs.items() if pair != left], axis=0)
    centre = poses[np.flatnonzero(pairs[left] & ~others)[0]]
    every = np.arange(BODY.size)
    assert not feasible(centre[None])[0]
    assert feasible.around(every, centre, forgive=True)(centre[None])[0]
    np.testing.assert_array_equal(feasible.around(every, centre, forgive=True)(poses), ~others)
    # Nothing to forgive: the same test as without.
    fine = poses[np.flatnonzero(feasible(poses))[0]]
    np.testing.assert_array_equal(
        feasible.around(every, fine, forgive=True)(poses), feasible(poses)
    )
