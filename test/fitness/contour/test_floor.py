"""No part of the body lies below the floor, and a foot stands on it."""

import numpy as np
import pytest

from markerless_tracker.body import cone_transforms, load_body, load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.arrays import body_arrays
from markerless_tracker.fitness.contour import ContourFrame, floor_rows, pose_jacobian, surface
from markerless_tracker.fitness.contour.chain_kernels import SUMS, sum_chain
from markerless_tracker.fitness.contour.floor import BELIEVED_M, SLACK_M, STANDING, add_floor
from markerless_tracker.fitness.raster.kernels import cone_ends
from markerless_tracker.fitness.raster.outline_arrays import LANES
from markerless_tracker.fitness.shape import BodyFit
from markerless_tracker.fitness.soles import FREE_TOE_SHARE, TOE_SHARE, ankles
from markerless_tracker.optim import Prior
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig


def lowest_m(body, pose):
    """The lowest points of the ends of all cones, by points around them."""
    placed = cone_transforms(body, pose)
    turn = np.linspace(0.0, 2.0 * np.pi, 721)
    low = []
    for at, shape, length in zip(placed, body.cone_shape, body.cone_length, strict=True):
        for end, (rx, ry, ox, oy) in enumerate(shape[:, :4]):
            x, y = ox + rx * np.cos(turn), oy + ry * np.sin(turn)
            points = np.stack([x, y, np.full_like(x, end * length), np.ones_like(x)])
            low.append((at[2] @ points).min())
    return np.array(low)


@pytest.fixture(params=["person31", "balan31"])
def sunk(request):
    """A body whose feet lie some centimetres below the floor."""
    body = load_body(request.param, 1.75)
    pose = body.neutral + 0.05 * np.random.default_rng(2).standard_normal(body.size)
    pose[body.index("pelvis_tz")] -= lowest_m(body, pose).min() + 0.06
    return body, pose


def ankles_above_m(body, pose):
    """Heights of the ankles above those in feet that stand flat."""
    placed, own = cone_transforms(body, pose), ankles(body)
    ends = [
        placed[c, 2] @ [*body.cone_shape[c, 1, 2:4], body.cone_length[c], 1.0] for c in own.cone
    ]
    return np.array(ends) - own.height_m


def of_ankles(rows):
    """Which rows (n,) are at the middle of a cone's end."""
    return (rows.place[:, :4] == 0.0).all(axis=1)


def robust(value):
    return 1.0 / (1.0 + (value / BELIEVED_M) ** 2) ** 2


def test_rows_are_the_lowest_points_of_the_ends_below_the_floor(sunk) -> None:
    body, pose = sunk
    rows = floor_rows(body, pose, 7.0)
    own = ~of_ankles(rows)
    expected = lowest_m(body, pose)
    expected = np.sort(expected[expected < -SLACK_M])
    np.testing.assert_allclose(np.sort(rows.value[own] - SLACK_M), expected, atol=1e-6)
    at_m = surface(body, pose, rows)[own, 2]
    np.testing.assert_allclose(at_m, rows.value[own] - SLACK_M, atol=1e-9)
    toes = [body.cone_names[c].endswith("foot") for c in rows.cone] * (rows.place[:, 4] == 1.0)
    expected = 7.0 * np.where(toes, TOE_SHARE, 1.0) * robust(rows.value)
    np.testing.assert_allclose(rows.weight[own], expected[own])


def test_rows_of_ankles_that_are_too_low(sunk) -> None:
    body, pose = sunk
    rows = floor_rows(body, pose, 7.0)
    own, above = of_ankles(rows), ankles_above_m(body, pose)
    assert own.sum() == len(above) == (2 if body.name == "person31" else 0)
    assert (above < -SLACK_M).all()
    np.testing.assert_allclose(rows.value[own], above + SLACK_M)
    np.testing.assert_allclose(rows.weight[own], 7.0 * robust(rows.value[own]))


@pytest.mark.parametrize("lift_m", [0.02, 0.15])
def test_the_lower_ankle_is_held_near_the_floor(lift_m: float) -> None:
    body = load_body("person32", 1.75)
    pose = body.neutral.copy()
    pose[body.index("r_knee")] = -0.9
    pose[body.index("pelvis_tz")] += lift_m - ankles_above_m(body, pose)[0]
    rows = floor_rows(body, pose, 7.0)
    assert [body.cone_names[c] for c in rows.cone] == ["l_shin"]
    np.testing.assert_allclose(rows.value, [lift_m])
    np.testing.assert_allclose(rows.weight, [7.0 * STANDING * robust(lift_m)])


@pytest.mark.parametrize("lift_m", [0.0, 0.1])
def test_the_kernel_sums_the_same_rows(sunk, lift_m: float) -> None:
    """Normal equations along the chain against those of the rows."""
    body, pose = sunk
    pose = pose.copy()
    pose[body.index("pelvis_tz")] += lift_m
    rows, arrays = floor_rows(body, pose, 7.0), body_arrays(body)
    nodes, world = np.empty((body.node_parent.size, 3, 4)), np.ones(18 * LANES)
    cone_ends(pose, arrays, nodes, world)
    sums = np.zeros((body.node_parent.size, SUMS))
    add_floor(arrays, world, 7.0, True, sums)
    hessian, gradient = np.empty((body.size, body.size)), np.empty(body.size)
    sum_chain(arrays, nodes, sums, np.empty((len(nodes) + 1, 6)), hessian, gradient)
    # The kernel takes the points below the axes instead of the lowest ones, which a translation of
    # the body does not tell apart.
    jacobian = pose_jacobian(body, pose, rows)
    up = body.index("pelvis_tz")
    assert hessian[up, up] == pytest.approx(rows.weight.sum())
    assert gradient[up] == pytest.approx(rows.weight @ rows.value)
    np.testing.assert_allclose(jacobian[:, up], 1.0)


def test_without_the_ankles_heights_toes_count_more(sunk) -> None:
    body, pose = sunk
    rows, arrays = floor_rows(body, pose, 7.0), body_arrays(body)
    nodes, world = np.empty((body.node_parent.size, 3, 4)), np.ones(18 * LANES)
    cone_ends(pose, arrays, nodes, world)
    sums = np.zeros((body.node_parent.size, SUMS))
    add_floor(arrays, world, 7.0, False, sums)
    own = ~of_ankles(rows)
    toes = [body.cone_names[c].endswith("foot") for c in rows.cone] * (rows.place[:, 4] == 1.0)
    expected = 7.0 * np.where(toes, FREE_TOE_SHARE, 1.0) * robust(rows.value)
    # The product of the vertical gradients is the third number of the upper triangle's diagonal.
    assert sums[:, 11].sum() == pytest.approx(expected[own].sum())


def test_a_body_far_from_the_floor_is_hardly_held(sunk) -> None:
    body, pose = sunk
    pose = pose.copy()
    pose[body.index("pelvis_tz")] -= 1.0
    deep = floor_rows(body, pose, 1.0)
    assert deep.value.min() < -1.0
    assert deep.weight[deep.value < -0.5].max() < 0.002
    pose[body.index("pelvis_tz")] += 2.0
    assert floor_rows(body, pose, 1.0).weight.sum() < 0.002


def blank_frame(body):
    """A frame without any silhouette: priors alone decide."""
    rig = ring_rig(3, (320, 240))
    nothing = np.zeros((240, 320), np.uint8)
    seen = {c.name: Observation.from_mask(c.name, 0, nothing > 0, nothing) for c in rig}
    views = Fitness(body, rig.cameras).lay_out(seen)
    return ContourFrame(
        body, {c.name: c for c in rig}, seen, views, pixels_per_m={c.name: 80.0 for c in rig}
    )


def test_a_refinement_lifts_the_feet_to_the_floor(sunk) -> None:
    body, pose = sunk
    frame = blank_frame(body)

    def refined(precision):
        return frame.refined(
            pose, precision=1e4, priors=(Prior(pose, np.full(body.size, 1.0 / 0.05**2)),),
            bounds=body.limits, iterations=8, truncation_m=(0.1, 0.1), floor_precision=precision,
        )  # fmt: skip

    np.testing.assert_array_equal(refined(0.0), np.clip(pose, *body.limits))
    # Toes, which count little, may lie a few millimetres lower than the ankles allow.
    assert lowest_m(body, refined(1.0 / 0.01**2)).min() > -SLACK_M - 0.008


def test_a_body_fit_lifts_the_feet_or_shortens_the_legs() -> None:
    description = load_description("person31")
    sizes = Sizes(description)
    body = sizes.of_stature(1.75)
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] -= lowest_m(body, pose).min() + 0.06
    low = {}
    for precision in (0.0, 1.0 / 0.01**2):
        fit = BodyFit(sizes, body, sizes.prior(1.75), body.limits, floor_precision=precision)
        fit.add(blank_frame(body), pose)
        for _ in range(6):
            list(fit.pieces(0.1))
        low[precision] = lowest_m(fit.body, fit.poses[0]).min()
    assert low[0.0] < -0.04
    assert low[1.0 / 0.01**2] > -SLACK_M - 0.01
