"""The compiled loops of contour refinement against slow twins and finite differences."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree

from markerless_tracker.body import (
    BodyModel,
    Subject,
    cone_transforms,
    load_body,
    load_description,
    transforms,
)
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.drawing import outlines, silhouette
from markerless_tracker.fitness import Fitness, threads
from markerless_tracker.fitness.arrays import body_arrays
from markerless_tracker.fitness.contour.chain_kernels import SUMS, add_wrench, sum_chain
from markerless_tracker.fitness.contour.frame import (
    SPACING_M,
    ContourFrame,
    SilhouetteContour,
    edge_of_mask,
)
from markerless_tracker.fitness.contour.outline_samples import MAX_SAMPLES
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)
STEP_PX = 2.0
SEAM_PX = STEP_PX + 2.0
"""How deep in a neighbouring part a sample may lie: the free step, and the kernel's coarse ends."""
DISTANCE_M = 4.5


@dataclass(frozen=True, eq=False)
class Scene:
    """A body in front of cameras, its silhouettes at one pose, and the contours they make."""

    body: BodyModel
    rig: CameraRig
    pose: FloatArray
    observations: dict[str, Observation]
    frame: ContourFrame

    @property
    def spacing_px(self) -> float:
        return SPACING_M * self.rig.cameras[0].matrix[0, 0] / DISTANCE_M

    def edges(self, camera: CameraModel) -> SilhouetteContour:
        return edge_of_mask(self.observations[camera.name], self.spacing_px)


def scene(name, seed, make_pose, *, lens=(0.0,) * 5, cameras=4, size=(656, 490), threads=1):
    body = load_body(name, 1.75)
    rig = ring_rig(cameras, size, distance_m=DISTANCE_M, distortion=lens)
    pose = make_pose(body, np.random.default_rng(seed), spread_m=0.2)
    observations = {}
    for camera in rig:
        mask = silhouette(body, pose, camera)
        observations[camera.name] = Observation.from_mask(
            camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
        )
    views = Fitness(body, rig.cameras).lay_out(observations)
    frame = ContourFrame(
        body, {c.name: c for c in rig}, observations, views,
        pixels_per_m={c.name: c.matrix[0, 0] / DISTANCE_M for c in rig},
        threads=threads, step_px=STEP_PX,
    )  # fmt: skip
    return Scene(body, rig, pose, observations, frame)


def standing(body: BodyModel) -> FloatArray:
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    return pose


BODIES = ("balan31", "person31")
CASES = [(name, seed, lens) for name in BODIES for seed, lens in ((3, LENS), (4, (0.0,) * 5))]


@pytest.fixture(scope="module", params=CASES, ids=lambda c: c[0] + ("-lens" if any(c[2]) else ""))
def posed(request, make_pose) -> Scene:
    """Silhouettes of a random pose, behind a strong lens or none."""
    name, seed, lens = request.param
    made = scene(name, seed, make_pose, lens=lens)
    made.frame.collect(made.pose, 0.1)
    return made


# --- outline points -------------------------------------------------------------------------


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
            assert away[side] < 0.05
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
    """cos and sin on both ends' ellipses and the share of end 1."""
    placed = cone_transforms(posed.body, posed.pose)
    samples = posed.frame.samples
    for v in range(len(posed.rig)):
        for s in range(0, samples.count[v], 3):
            c = samples.cone[v, s]
            *turns, t = samples.shape[v, s]
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
    """What a sample stands for, back in px: the whole free outline, but for the corners.

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


def test_samples_along_a_side_are_evenly_spaced_in_the_image(make_pose) -> None:
    """Also where a limb points at the camera, and steps along it are not."""
    made = scene("person31", 4, make_pose)
    made.frame.collect(made.pose, 0.1)
    samples, compared, uneven = made.frame.samples, 0, 0.0
    for v in range(len(made.rig)):
        n = samples.count[v]
        for c in range(len(made.body.cone_names)):
            (mine,) = np.nonzero(samples.cone[v, :n] == c)
            for side in np.unique(samples.shape[v, mine, :4], axis=0):
                on = mine[(samples.shape[v, mine, :4] == side).all(axis=1)]
                if on.size < 4:
                    continue
                gap = np.linalg.norm(np.diff(samples.pixel[v, on], axis=0), axis=1)
                # Points that other parts hide are left out.
                steps = gap / gap.min()
                np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
                compared += on.size
                along = np.diff(samples.shape[v, on, 4]) / np.rint(steps)
                uneven = max(uneven, np.ptp(along) / along.mean())
    assert compared > 500 and uneven > 0.02


def test_parts_outside_the_frame_have_no_samples(make_pose) -> None:
    made = scene("person31", 5, make_pose, lens=LENS)
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


def test_a_body_behind_a_camera_has_no_samples_there(make_pose) -> None:
    made = scene("person31", 6, make_pose)
    pose = made.pose.copy()
    eye = made.rig.cameras[0].T_world_cam
    pose[[made.body.index(f"pelvis_t{a}") for a in "xyz"]] = eye[:3, 3] - 2.0 * eye[:3, 2]
    made.frame.equations(pose, 0.1)
    assert made.frame.samples.count[0] == 0
    assert np.isfinite(made.frame.equations(pose, 0.1).cost)


def test_more_samples_than_there_is_room_for() -> None:
    """A giant; the last ones are left out, and nothing is written beyond the room."""
    description = load_description("person31")
    body = load_body("person31", Subject("giant", dict.fromkeys(description.lengths, 2.9)))
    (camera,) = rig = ring_rig(1, (2400, 1800), distance_m=30.0, distortion=(0.0,) * 5)
    nothing = np.zeros((1800, 2400), np.uint8)
    blank = {camera.name: Observation.from_mask(camera.name, 0, nothing, nothing)}
    views = Fitness(body, rig.cameras).lay_out(blank)
    frame = ContourFrame(body, {camera.name: camera}, blank, views, pixels_per_m={camera.name: 80})
    pose = standing(body)
    pose[body.index("l_shoulder_x")] += 1.2
    found = frame.equations(pose, 0.1)
    assert frame.samples.count[0] == MAX_SAMPLES
    assert np.isfinite(found.cost) and np.isfinite(frame.samples.world[0]).all()


# --- residuals ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Twin:
    """Residuals of one view: values (n,), weights (n,), samples (n,), and what they measure.

    Attributes:
        along: (n, 2) the residual's change by its sample's pixel.
        cost: sum of length times Tukey's cost.
    """

    value: FloatArray
    weight: FloatArray
    sample: FloatArray
    along: FloatArray
    cost: float


def tukey(r, truncation):
    return truncation**2 / 6.0 * (1.0 - max(0.0, 1.0 - (r / truncation) ** 2) ** 3)


def bilinear(edge: SilhouetteContour, point):
    """Distance at a point (2,) and its gradient (2,); None outside the window."""
    x, y = point - (edge.left, edge.top)
    height, width = edge.distance.shape
    if not (0 <= x < width - 1 and 0 <= y < height - 1):
        return None
    i, j = int(x), int(y)
    d = edge.distance[j : j + 2, i : i + 2].astype(np.float64)
    a, b = np.array([1 - (x - i), x - i]), np.array([1 - (y - j), y - j])
    return b @ d @ a, np.array([b @ d @ [-1.0, 1.0], np.array([-1.0, 1.0]) @ d @ a])


def slow_residuals(made: Scene, view: int, truncation: float) -> Twin:
    """Both ways, one at a time, as the documentation of the kernels says."""
    camera, samples = made.rig.cameras[view], made.frame.samples
    focal, n = camera.matrix[0, 0], samples.count[view]
    pixel, normal, depth, length = (
        getattr(samples, k)[view, :n] for k in ("pixel", "normal", "depth", "length")
    )
    edge = made.edges(camera)
    rows, cost = [], 0.0
    for s in range(n):
        found = bilinear(edge, pixel[s])
        kept = found is not None
        if kept:
            value, slope = found[0] * depth[s] / focal, found[1]
            steep = np.linalg.norm(slope)
            # Neither on ridges of the distance nor where the edge faces another way.
            kept = steep >= 0.3 and slope @ normal[s] >= 0.5 * steep and abs(value) < truncation
        cost += length[s] * (tukey(value, truncation) if kept else truncation**2 / 6.0)
        if kept:
            weight = length[s] * (1.0 - (value / truncation) ** 2) ** 2
            rows.append((value, weight, s, slope * depth[s] / focal))
    for at, out, px in zip(edge.points, edge.normals, edge.spacing, strict=True):
        facing = np.flatnonzero(normal @ out > 0.5)
        away = np.linalg.norm(pixel[facing] - at, axis=1)
        near = int(facing[away.argmin()]) if facing.size else 0
        metres = depth[near] / focal
        far = away.min() * metres if facing.size else np.inf
        cost += px * metres * tukey(min(far, truncation), truncation)
        if far < truncation:
            value = (pixel[near] - at) @ out * metres
            weight = px * metres * (1.0 - (far / truncation) ** 2) ** 2
            rows.append((value, weight, near, out * metres))
    value, weight, sample, along = map(np.array, zip(*rows, strict=True))
    return Twin(value, weight, sample, along, cost)


def disturbed(made: Scene, seed=0, size=0.06) -> FloatArray:
    pose = made.pose + size * np.random.default_rng(seed).uniform(-1, 1, made.body.size)
    return np.asarray(pose)


@pytest.mark.parametrize("truncation", [0.03, 0.1])
def test_residuals_weights_and_cost(posed, truncation) -> None:
    posed.frame.collect(disturbed(posed), truncation)
    kept = outliers = 0
    for v in range(len(posed.rig)):
        slow = slow_residuals(posed, v, truncation)
        fast = posed.frame.residuals
        n = fast.count[v]
        assert n == len(slow.value) > 30
        np.testing.assert_array_equal(fast.sample[v, :n], slow.sample)
        np.testing.assert_allclose(fast.value[v, :n], slow.value, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(fast.weight[v, :n], slow.weight, rtol=1e-6, atol=1e-12)
        assert fast.cost[v] == pytest.approx(slow.cost, rel=1e-7)
        both = posed.frame.samples.count[v] + len(posed.edges(posed.rig.cameras[v]).points)
        kept, outliers = kept + n, outliers + both - n
    # The truncation leaves some out, and not all.
    assert kept > 300 and outliers > 0.01 * kept


def test_gradients_by_the_world_point(posed) -> None:
    """Moving a sample's world point by a little moves its pixel, hence its residual."""
    posed.frame.collect(disturbed(posed), 0.1)
    h = 1e-5
    for v, camera in enumerate(posed.rig):
        slow = slow_residuals(posed, v, 0.1)
        fast = posed.frame.residuals.gradient[v, : len(slow.value)]
        world = posed.frame.samples.world[v, slow.sample]
        numeric = np.empty_like(fast)
        for axis in range(3):
            step = h * np.eye(3)[axis]
            moved = project_camera(world + step, camera) - project_camera(world - step, camera)
            numeric[:, axis] = (slow.along * moved).sum(axis=1) / (2 * h)
        scale = np.linalg.norm(numeric, axis=1, keepdims=True)
        assert (scale > 0.3).all()
        assert (np.abs(fast - numeric) / scale).max() < 1e-6


def test_one_residual_by_hand() -> None:
    """A body 20 mm beside its silhouette: sideways residuals are 20 mm, weighted by Tukey."""
    made = scene("balan31", 0, lambda body, *_, **__: standing(body), cameras=1)
    camera, truncation = made.rig.cameras[0], 0.05
    pose = made.pose.copy()
    pose[[made.body.index(f"pelvis_t{a}") for a in "xyz"]] += 0.020 * camera.T_cam_world[0, :3]
    made.frame.collect(pose, truncation)
    residuals, samples = made.frame.residuals, made.frame.samples
    s = residuals.sample[0, : residuals.count[0]]
    value, weight = residuals.value[0, : s.size], residuals.weight[0, : s.size]
    leg = np.isin(samples.cone[0, s], [made.body.cone_names.index(c) for c in ("l_calf", "r_calf")])
    side = samples.normal[0, s, 0]
    for sense in (1.0, -1.0):
        found = value[leg & (sense * side > 0.99)]
        assert found.size > 15
        assert np.median(found) == pytest.approx(sense * 0.020, abs=0.0035)
        # From both ways: the body's points to the edge, the edge's points to the body.
        assert found.std() < 0.005
    first = int(np.flatnonzero(leg & (np.abs(side) > 0.99))[0])
    # 1 - (20 mm / 50 mm)² = 0.84, squared 0.7056.
    share = weight[first] / samples.length[0, s[first]]
    assert share == pytest.approx((1.0 - (value[first] / 0.05) ** 2) ** 2, rel=1e-12)
    assert share == pytest.approx(0.7056, abs=0.12)


def test_no_evidence_costs_the_most_and_pulls_nowhere(make_pose) -> None:
    made = scene("person31", 8, make_pose)
    blank = {
        name: Observation.from_mask(name, 0, np.zeros_like(o.mask), o.edges)
        for name, o in made.observations.items()
    }
    frame = ContourFrame(
        made.body, {c.name: c for c in made.rig}, blank, Fitness(made.body, made.rig.cameras)
        .lay_out(blank), pixels_per_m=dict.fromkeys(made.rig.names, 150.0),
    )  # fmt: skip
    found = frame.equations(made.pose, 0.1)
    assert not found.hessian.any() and not found.slope.any()
    total = sum(frame.samples.length[v, : frame.samples.count[v]].sum() for v in range(4))
    assert found.cost == pytest.approx(total * 0.1**2 / 6.0)


# --- derivatives by the pose ------------------------------------------------------------------


def attached(body, pose, cone, world):
    """`world` (n, 3) points on cones (n,) as a function of the pose, rigid with their cones."""
    placed = cone_transforms(body, pose)[cone]
    local = np.einsum("nji,nj->ni", placed[:, :, :3], world - placed[:, :, 3])

    def moved(other):
        now = cone_transforms(body, other)[cone]
        return np.einsum("nij,nj->ni", now[:, :, :3], local) + now[:, :, 3]

    return moved


def numeric_jacobian(function, pose, h=1e-5):
    """(n, .., p) central differences."""
    columns = []
    for i in range(pose.size):
        step = h * np.eye(pose.size)[i]
        columns.append((function(pose + step) - function(pose - step)) / (2 * h))
    return np.stack(columns, axis=-1)


def test_slopes_along_the_chain(posed) -> None:
    """The chain's derivatives of gradient . point, for points on every cone."""
    body, rng = posed.body, np.random.default_rng(2)
    pose = disturbed(posed)
    nodes = transforms(body, pose)
    cone = np.repeat(np.arange(len(body.cone_names)), 3)
    placed = cone_transforms(body, pose)[cone]
    world = placed[:, :, 3] + rng.uniform(-0.3, 0.3, (cone.size, 3))
    gradient = rng.standard_normal((cone.size, 3))
    slow = np.einsum(
        "nip,ni->np", numeric_jacobian(attached(body, pose, cone, world), pose), gradient
    )
    arrays = body_arrays(body)
    reached = set()
    hessian, fast = np.empty((body.size, body.size)), np.empty(body.size)
    for i, c in enumerate(cone):
        sums = np.zeros((nodes.shape[0], SUMS))
        add_wrench(*world[i], *gradient[i], 2.0, 0.5, sums, body.cone_node[c])
        sum_chain(arrays, nodes, sums, hessian, fast)
        np.testing.assert_allclose(fast, slow[i], atol=1e-7)
        np.testing.assert_allclose(hessian, 2.0 * np.outer(slow[i], slow[i]), atol=1e-6)
        reached.update(np.flatnonzero(fast))
    assert reached == set(range(31))


def test_normal_equations(posed) -> None:
    """JᵀWJ and JᵀWr of the slow residuals, J by finite differences through the lens."""
    pose, truncation = disturbed(posed, seed=1), 0.08
    found = posed.frame.equations(pose, truncation)
    hessian, slope, cost = np.zeros((31, 31)), np.zeros(31), 0.0
    for v, camera in enumerate(posed.rig):
        slow = slow_residuals(posed, v, truncation)
        samples = posed.frame.samples
        points = attached(
            posed.body, pose, samples.cone[v, slow.sample], samples.world[v, slow.sample]
        )
        pixels = numeric_jacobian(lambda x, f=points, c=camera: project_camera(f(x), c), pose)
        rows = np.einsum("nip,ni->np", pixels, slow.along)
        hessian += rows.T @ (slow.weight[:, None] * rows)
        slope += rows.T @ (slow.weight * slow.value)
        cost += slow.cost
    scale = np.sqrt(np.outer(np.diag(hessian), np.diag(hessian)))
    assert np.diag(hessian).min() > 0
    assert np.abs(found.hessian - hessian).max() < 1e-5 * np.abs(hessian).max()
    assert (np.abs(found.hessian - hessian) / scale).max() < 1e-5
    np.testing.assert_allclose(found.slope, slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())
    assert found.cost == pytest.approx(cost, rel=1e-7)
    np.testing.assert_allclose(found.hessian, found.hessian.T, rtol=1e-12)


def test_the_slope_points_downhill(posed) -> None:
    """Along the damped step the robust cost falls: residuals and derivatives fit together."""
    pose = disturbed(posed, seed=2, size=0.02)
    found = posed.frame.equations(pose, 0.1)
    a = found.hessian + np.diag(0.1 * np.diag(found.hessian) + 1e-9)
    step = np.linalg.solve(a, -found.slope)
    assert found.slope @ step < 0
    costs = [posed.frame.equations(pose + t * step, 0.1).cost for t in (0.0, 0.25, 0.5, 1.0)]
    assert costs[1] < costs[0] and costs[2] < costs[1] and costs[3] < 0.5 * costs[0]


# --- threads and memory -----------------------------------------------------------------------


def test_threads_and_earlier_calls_change_nothing(monkeypatch, make_pose) -> None:
    monkeypatch.setattr(threads, "launch_cost_s", lambda count: 0.0)
    one = scene("person31", 9, make_pose, lens=LENS, threads=1)
    two = scene("person31", 9, make_pose, lens=LENS, threads=2)
    pose = disturbed(one)
    first = one.frame.equations(pose, 0.1)
    one.frame.equations(one.pose, 0.02)
    for other in (one.frame.equations(pose, 0.1), two.frame.equations(pose, 0.1)):
        assert other.hessian.tobytes() == first.hessian.tobytes()
        assert other.slope.tobytes() == first.slope.tobytes()
        assert other.cost == first.cost
