"""The compiled loops against the slow twin of `conftest`.

Tolerances: the kernel draws a cone's end as an arc of seven points, so pixel counts may differ by
a strip 0.06 px wide along all outlines (0.1 px where cones are seen end-on); f_s by 0.005. Edge
samples may lie on the other side of a hiding part's boundary: their number may differ by 2 and
5 %, the mean of the map by 0.01.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.fitness import EDGE_RULES, Fitness
from markerless_tracker.fitness.edge_samples import EdgeRule, sample_side
from markerless_tracker.fitness.fill import clear_used, fill_outline
from markerless_tracker.fitness.outline import LANES, make_outlines, outlines_of, scan_edges
from markerless_tracker.fitness.terms import EDGE_COUNT, EDGE_SUM, EDGE_TOP, OVERLAP, PROJECTED
from markerless_tracker.records import Observation, unpack_mask
from markerless_tracker.synthesis import look_at

STRIP_PX = 0.06
END_ON_STRIP_PX = 0.1
LANE = 3
"""Which of the polygons that are worked on side by side the tests fill."""


def check_silhouettes(
    twin, body: BodyModel, cameras, poses, make_observation, strip_px: float = STRIP_PX
) -> int:
    """Compare counts and f_s of poses seen by cameras; returns the pixels that were compared."""
    fitness = Fitness(body, cameras, threads=1)
    every = np.ones(len(body.cone_names), dtype=bool)
    compared = 0
    for pose in poses:
        moved = pose.copy()
        moved[body.root[3:]] += [0.04, -0.03, 0.02]
        masks = {c.name: twin(body, c, moved).silhouette() for c in cameras}
        views = fitness.lay_out({c.name: make_observation(c, masks[c.name]) for c in cameras})
        counts = fitness.count(views, pose[None].copy(), every, every)[0]
        terms = fitness.terms(views, pose)
        for row, camera in zip(counts, cameras, strict=True):
            slow = twin(body, camera, pose)
            drawn, mask = slow.silhouette(), masks[camera.name]
            strip = strip_px * slow.perimeter()
            both = int((drawn & mask).sum())
            assert abs(row[OVERLAP] - both) <= strip
            assert abs(row[PROJECTED] - drawn.sum()) <= strip
            # Four samples a pixel in each direction: whole pixels are not biased.
            assert abs(row[PROJECTED] - slow.silhouette(samples=4).sum() / 16) <= strip
            if drawn.any() and mask.any():
                f_s = 0.5 * both / drawn.sum() + 0.5 * both / mask.sum()
                assert terms[camera.name].silhouette == pytest.approx(f_s, abs=0.005)
                iou = both / (drawn | mask).sum()
                assert terms[camera.name].overlap == pytest.approx(iou, abs=0.01)
            compared += int(drawn.sum())
    return compared


@pytest.mark.parametrize("lens", [False, True], ids=["pinhole", "lens"])
@pytest.mark.parametrize("name", ["body", "elliptic_body", "person"])
def test_silhouettes(request, twin, make_pose, make_observation, rig, lens_rig, name, lens):
    shown = request.getfixturevalue(name)
    rng = np.random.default_rng([len(name), lens])
    # Nearly centred, then partly outside of some frames.
    poses = [make_pose(shown, rng, spread_m=spread) for spread in (0.3, 1.8)]
    cameras = (lens_rig if lens else rig).cameras
    assert check_silhouettes(twin, shown, cameras, poses, make_observation) > 5000


@pytest.mark.parametrize("flat", [False, True], ids=["round", "elliptic"])
@pytest.mark.parametrize("behind", [False, True], ids=["from the far end", "from the near end"])
@pytest.mark.parametrize("cone", ["l_forearm", "torso", "r_thigh"])
def test_cones_seen_end_on(twin, make_observation, make_pose, body, cone, behind, flat):
    shape = body.cone_shape.copy()
    if flat:
        # Both ends equally flat: ends that cross are drawn too small when seen end-on.
        shape[:, :, 1] *= 0.6
        shape[:, :, 2:] = [0.02, -0.03]
    shown = replace(body, cone_shape=shape)
    index = body.cone_names.index(cone)
    pose = make_pose(body, np.random.default_rng(5), spread_m=0.0)
    place = cone_transforms(body, pose)[index]
    axis = place[:, 2] * (-1.0 if behind else 1.0)
    middle = place[:, 3] + place[:, 2] * 0.5 * body.cone_length[index]
    matrix = np.array([[300.0, 0.0, 119.5], [0.0, 300.0, 99.5], [0.0, 0.0, 1.0]])
    cameras = [
        CameraModel(
            f"c{i}", (240, 200), matrix, np.zeros(5),
            look_at(middle + 2.0 * axis + offset, middle),
        )
        for i, offset in enumerate(([0.0, 0.0, 0.0], [0.05, 0.02, -0.03], [0.0, 0.25, 0.1]))
    ]  # fmt: skip
    # Seen exactly along its axis, one end of a round cone hides the other.
    assert flat or not twin(shown, cameras[0], pose).tangents(index)
    assert check_silhouettes(twin, shown, cameras, [pose], make_observation, END_ON_STRIP_PX) > 5000


@pytest.mark.parametrize("rule", EDGE_RULES)
@pytest.mark.parametrize("lens", [False, True], ids=["pinhole", "lens"])
@pytest.mark.parametrize("squared", [False, True], ids=["mean", "ssd"])
def test_edge_sums(
    twin, make_pose, make_observation, smooth_edges, elliptic_body, rig, lens_rig, rule, lens,
    squared,
):  # fmt: skip
    body, cameras = elliptic_body, (lens_rig if lens else rig).cameras
    rng = np.random.default_rng(7 + lens)
    fitness = Fitness(
        body, cameras, edge_rule=rule, edge_term="ssd" if squared else "mean",
        edge_spacing_px=3.0, edge_step_px=2.0,
    )  # fmt: skip
    every = np.ones(len(body.cone_names), dtype=bool)
    some = every.copy()
    some[body.cone_names.index("l_thigh")] = False
    for number, (spread, drawn, sampled) in enumerate(((0.3, every, every), (1.5, some, some))):
        pose = make_pose(body, rng, spread_m=spread)
        edges = {c.name: smooth_edges(c, number) for c in cameras}
        blank = np.zeros(cameras[0].size_px[::-1], dtype=bool)
        views = fitness.lay_out(
            {c.name: make_observation(c, blank, edges[c.name]) for c in cameras}
        )
        counts = fitness.count(views, pose[None].copy(), drawn, sampled)[0]
        for row, camera in zip(counts, cameras, strict=True):
            slow = twin(body, camera, pose).edges(
                edges[camera.name], rule, body.cone_edges & sampled[:, None], drawn,
                spacing_px=3.0, step_px=2.0,
            )  # fmt: skip
            assert abs(row[EDGE_COUNT] - slow.count) <= 2 + 0.05 * slow.count
            if slow.count >= 20:
                mean = (slow.squared if squared else slow.total) / slow.count
                top = EDGE_TOP ** (2 if squared else 1)
                assert row[EDGE_SUM] / row[EDGE_COUNT] / top == pytest.approx(mean, abs=0.01)


def test_the_rules_sample_ever_fewer_edges(make_pose, make_observation, body, rig):
    pose = make_pose(body, np.random.default_rng(3), spread_m=0.2)
    every = np.ones(len(body.cone_names), dtype=bool)
    totals = []
    for rule in ("sides", "visible", "outline"):
        fitness = Fitness(body, rig.cameras, edge_rule=rule)
        blank = np.zeros(rig.cameras[0].size_px[::-1], dtype=bool)
        views = fitness.lay_out({c.name: make_observation(c, blank) for c in rig})
        counts = fitness.count(views, pose[None].copy(), every, every)
        totals.append(counts[0, :, EDGE_COUNT].sum())
    assert totals[0] > totals[1] > totals[2] > 0


def test_the_head_is_never_sampled_and_the_torsos_upper_edge_is(make_observation, body, rig):
    camera = rig.cameras[0]
    fitness = Fitness(body, [camera], edge_rule="sides", edge_spacing_px=3.0)
    pose = body.neutral.copy()
    pose[body.index("pelvis_tz")] = 0.95
    blank = np.zeros(camera.size_px[::-1], dtype=bool)
    views = fitness.lay_out({camera.name: make_observation(camera, blank)})
    counts = {}
    for name in ("head", "torso", "l_thigh"):
        chosen = np.array([cone == name for cone in body.cone_names])
        counts[name] = fitness.count(views, pose[None].copy(), chosen, chosen)[0, 0]
    assert counts["head"][EDGE_COUNT] == 0 < counts["head"][PROJECTED]
    lines = {
        name: np.linalg.norm(np.diff(line(body, camera, pose, name), axis=0))
        for name in ("torso", "l_thigh")
    }
    for name, extra in (("torso", True), ("l_thigh", False)):
        sides = 2 * (lines[name] / 3.0)
        assert (counts[name][EDGE_COUNT] > 1.15 * sides) == extra


def line(body: BodyModel, camera: CameraModel, pose, cone: str):
    """The image (2, 2) of a cone's axis."""
    index = body.cone_names.index(cone)
    place = cone_transforms(body, pose)[index]
    ends = [place[:, 3], place[:, 3] + place[:, 2] * body.cone_length[index]]
    return project_camera(np.array(ends), camera)


def test_silhouette_cones_choose_what_is_drawn(twin, make_pose, make_observation, body, rig):
    pose = make_pose(body, np.random.default_rng(9), spread_m=0.2)
    arms = np.array(["arm" in name for name in body.cone_names])
    fitness = Fitness(body, rig.cameras)
    full = np.ones(rig.cameras[0].size_px[::-1], dtype=bool)
    views = fitness.lay_out({c.name: make_observation(c, full) for c in rig})
    counts = fitness.count(views, pose[None].copy(), arms, np.zeros_like(arms))[0]
    for row, camera in zip(counts, rig, strict=True):
        slow = twin(body, camera, pose)
        drawn = slow.silhouette(arms).sum()
        assert abs(row[PROJECTED] - drawn) <= STRIP_PX * slow.perimeter()
        assert row[OVERLAP] == row[PROJECTED] > 0


def fill(points, width: int, height: int):
    """Words (w, h) and mask (h, w) that `fill_outline` sets, and the rows it says it used."""
    words = (width + 63) // 64
    bits = np.zeros(words * height, dtype=np.uint64)
    used = np.empty((words, 2), dtype=np.int64)
    clear_used(words, height, used)
    out = outlines_of(make_outlines(1, height), 0)
    for i, (u, v) in enumerate(np.asarray(points, dtype=np.float64)):
        out.u[i * LANES + LANE], out.v[i * LANES + LANE] = u, v
    # Whatever an earlier polygon left behind must not matter.
    out.left[:], out.right[:] = 7.0, 20.0
    scan_edges(LANE + 1, len(points), height, out.u, out.v, out.first, out.slope, out.box)
    fill_outline(LANE, len(points), out, width, height, bits, used)
    frame = bits.reshape(words, height)
    return frame, unpack_mask(np.ascontiguousarray(frame.T), width), used


def inside_convex(points, width: int, height: int):
    """Pixel centres strictly inside, and those within 1e-6 px of the boundary, (h, w) both."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    following = np.roll(points, -1, axis=0)
    area = np.sum(points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0])
    least = np.full((height, width), np.inf)
    for (pu, pv), (qu, qv) in zip(points, following, strict=True):
        length = np.hypot(qu - pu, qv - pv)
        side = np.sign(area) * ((qu - pu) * (v - pv) - (qv - pv) * (u - pu)) / length
        least = np.minimum(least, side)
    return least > 1e-6, np.abs(least) <= 1e-6


@settings(deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 14),
    st.floats(0.3, 120.0),
    st.tuples(st.floats(-40.0, 190.0), st.floats(-40.0, 110.0)),
    st.booleans(),
)
def test_convex_polygons_fill_exactly_the_pixel_centres_inside(seed, corners, size, at, clockwise):
    width, height = 150, 70
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    stretch = rng.uniform(0.2, 1.0, 2)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * stretch * size + at
    points = points[::-1] if clockwise else points
    if np.min(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)) < 1e-3:
        return
    words, filled, used = fill(points, width, height)
    inside, undecided = inside_convex(points, width, height)
    np.testing.assert_array_equal(filled[~undecided], inside[~undecided])
    # Only what is said to be used is wiped afterwards.
    for column, (first, last) in zip(words, used, strict=True):
        assert not column[:first].any() and not column[last + 1 :].any()


def test_two_polygons_that_share_an_edge_leave_no_gap():
    """Between the pixels of two halves lies none that neither holds."""
    left = np.array([[10.2, 5.1], [30.7, 8.3], [25.4, 40.9], [8.8, 33.3]])
    right = np.array([[30.7, 8.3], [55.5, 3.2], [60.1, 44.4], [25.4, 40.9]])
    whole = inside_convex(left, 80, 60)[0] | inside_convex(right, 80, 60)[0]
    assert not (whole & ~(fill(left, 80, 60)[1] | fill(right, 80, 60)[1])).any()


@pytest.mark.parametrize(
    "points",
    [
        [[1e300, -1e300], [1e300, 1e300], [-1e300, 1e300]],
        [[np.nan, 3.0], [4.0, 5.0], [6.0, np.nan]],
        [[np.inf, 3.0], [-np.inf, 5.0], [6.0, 9.0]],
        [[5.5, 5.5], [5.5, 5.5], [5.5, 5.5]],
    ],
    ids=["huge", "nan", "infinite", "empty"],
)
def test_polygons_that_are_none_stay_inside_the_frame(points):
    words, _, _ = fill(np.array(points), 70, 30)
    padding = unpack_mask(np.ascontiguousarray(words.T), 128)[:, 70:]
    assert not padding.any()


def sample(p, q, edges, rule: str, *, bits=None, outward=1.0, spacing=5.0, squared=False):
    height, width = edges.shape
    rows = np.zeros((height, (width + 63) // 64), dtype=np.uint64) if bits is None else bits
    total, number, _ = sample_side(
        float(p[0]), float(p[1]), float(q[0]), float(q[1]), outward, rows.T.ravel(),
        np.empty(0, dtype=np.uint64), 0, edges.ravel(), 0, width, height,
        EdgeRule(EDGE_RULES[rule], spacing, 2.0, squared), None, 0,
    )  # fmt: skip
    return number, total / EDGE_TOP ** (2 if squared else 1)


def test_samples_of_one_side_by_hand():
    edges = np.zeros((40, 60), dtype=np.uint8)
    edges[10, 20:30] = 255
    # Nine samples at 12.5, 17.5 .. 52.5 px; two of them, at 22.5 and 27.5, meet the edge.
    assert sample([10, 10], [55, 10], edges, "sides") == (9, 2.0)
    assert sample([10, 10], [55, 10], edges, "sides", squared=True) == (9, 7.0)
    # Never fewer than four: 10.375, 11.125, 11.875, 12.625.
    assert sample([10, 20], [13, 20], edges, "sides")[0] == 4
    # Those outside the frame do not count: 52.5, 57.5 of 50 .. 80 remain.
    assert sample([50, 10], [80, 10], edges, "sides")[0] == 2
    assert sample([-50, 10], [-5, 10], edges, "sides")[0] == 0
    assert sample([5, 5], [5, 5], edges, "sides") == (0, 0.0)
    assert sample([np.nan, 5], [5, 5], edges, "sides") == (0, 0.0)


def test_what_hides_a_sample():
    edges = np.zeros((40, 64), dtype=np.uint8)
    body = Observation.from_mask("c", 0, np.zeros((40, 64), bool), edges).mask_words.copy()
    body[20:, :] = np.uint64(2**64 - 1)
    p, q = [10, 19], [30, 19]
    # Row 19 is free, rows 20 and on are body.
    assert sample(p, q, edges, "visible", bits=body)[0] == 4
    assert sample([10, 20], [30, 20], edges, "visible", bits=body)[0] == 0
    # Outline: from row 19, two px outwards lies row 21 or row 17.
    assert sample(p, q, edges, "outline", bits=body, outward=1.0)[0] == 0
    assert sample(p, q, edges, "outline", bits=body, outward=-1.0)[0] == 4
    # Beyond the frame's border nothing hides.
    assert sample([10, 39], [30, 39], edges, "outline", bits=body, outward=1.0)[0] == 4


def test_a_camera_in_the_middle_of_the_body_draws_what_is_in_front(make_pose, body):
    """Cones that come too near to a camera's plane are left out, the rest stays finite."""
    pose = make_pose(body, np.random.default_rng(2), spread_m=0.0)
    eye = cone_transforms(body, pose)[body.cone_names.index("torso")][:, 3]
    matrix = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 40.0], [0.0, 0.0, 1.0]])
    camera = CameraModel("in", (100, 80), matrix, np.zeros(5), look_at(eye, eye + [1.0, 0.2, 0.1]))
    rig = CameraRig((camera,))
    fitness = Fitness(body, rig.cameras)
    mask = np.ones((80, 100), dtype=bool)
    views = fitness.lay_out({"in": Observation.from_mask("in", 0, mask, mask.astype(np.uint8))})
    every = np.ones(len(body.cone_names), dtype=bool)
    counts = fitness.count(views, pose[None].copy(), every, every)
    assert np.isfinite(counts).all()
    assert 0 <= counts[0, 0, OVERLAP] == counts[0, 0, PROJECTED] <= 8000
