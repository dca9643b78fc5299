"""The compiled loops against the slow twin of `conftest`.

Tolerances: the kernel draws a cone's end as an arc of seven points, so pixel counts may differ by
a strip 0.06 px wide along all outlines (0.1 px where cones are seen end-on); f_s by 0.005. Edge
samples may lie on the other side of a hiding part's boundary: their number may differ by 2 and
5 %, the mean of the map by 0.01.
"""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.fitness import EDGE_RULES, Fitness
from markerless_tracker.fitness.terms import EDGE_COUNT, EDGE_SUM, EDGE_TOP, OVERLAP, PROJECTED
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import look_at

STRIP_PX = 0.06
END_ON_STRIP_PX = 0.1


def check_silhouettes(
    twin, body: BodyModel, cameras, poses, make_observation, strip_px: float = STRIP_PX
) -> int:
    """Compare counts and f_s of poses seen by cameras; returns the number of compared pixels."""
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
            # Four samples per pixel in each direction: pixel centres are unbiased.
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
