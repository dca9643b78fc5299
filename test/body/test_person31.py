"""The shipped body with the shape of a person, compared with the published one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.body import (
    MARKER_NAMES,
    Feasibility,
    Subject,
    cone_transforms,
    load_body,
    load_description,
    markers,
    pose_from_markers,
    read_subject,
    subject_from_markers,
    subject_from_stature,
    write_subject,
)
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.build import build_body
from markerless_tracker.datasets import read_trc
from markerless_tracker.tracking import TrackerConfig

BODY = load_body("person31", 1.75)
PUBLISHED = load_body("balan31", 1.75)
DESCRIPTION = load_description("person31")
SMALLER = load_description("balan31")
NAMES = BODY.cone_names
SEEDS = st.integers(0, 2**32 - 1)


def cone(name) -> int:
    return NAMES.index(name)


# --- the same skeleton as the published body -----------------------------------------------------


def test_the_prior_mean_has_bent_elbows_and_is_neutral_elsewhere() -> None:
    for name in ("person31", "person32", "person34", "person35"):
        body = load_body(name, 1.72)
        elbows = [body.index("l_elbow"), body.index("r_elbow")]
        bent = np.abs(body.prior_mean - body.neutral)
        np.testing.assert_allclose(bent[elbows], np.deg2rad(30.0))
        assert np.count_nonzero(bent) == 2
        assert (body.limits[0] < body.prior_mean).all() and (body.prior_mean < body.limits[1]).all()


def test_parameters_are_the_published_bodys_but_for_hips_and_shoulders() -> None:
    assert BODY.parameter_names == PUBLISHED.parameter_names and BODY.size == 31
    balls = [i for i, n in enumerate(BODY.parameter_names) if "hip_" in n or "shoulder_" in n]
    same = np.setdiff1d(np.arange(31), balls)
    for name in ("sigma", "walking_limits", "prior_sd"):
        mine, published = getattr(BODY, name), getattr(PUBLISHED, name)
        np.testing.assert_array_equal(mine[..., same], published[..., same], err_msg=name)
    assert np.isinf(BODY.walking_limits[:, balls]).all()
    # Shoulders hang lower than on the walker that the published limits were learned from.
    lower = np.zeros(31)
    lower[[BODY.index("l_clavicle_x"), BODY.index("r_clavicle_x")]] = np.deg2rad([6.0, -6.0])
    for name in ("neutral", "limits"):
        mine, published = getattr(BODY, name), getattr(PUBLISHED, name)
        np.testing.assert_allclose(
            mine[..., same], (published + lower)[..., same], atol=1e-12, err_msg=name
        )
    assert set(BODY.subspaces) == set(PUBLISHED.subspaces)
    for name, members in BODY.subspaces.items():
        np.testing.assert_array_equal(members, PUBLISHED.subspaces[name])


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_markers_are_the_published_bodys_at_equal_lengths_and_pose(seed) -> None:
    rng = np.random.default_rng(seed)
    lengths = {name: float(rng.uniform(0.1, 0.6)) for name in DESCRIPTION.lengths}
    bones = {name: lengths[name] for name in SMALLER.lengths}
    angles = dict(zip(BODY.parameter_names, rng.uniform(-1.4, 1.4, 31), strict=True))
    mine = build_body(DESCRIPTION, Subject("random", lengths))
    published = build_body(SMALLER, Subject("random", bones))
    # The neutral clavicles hang lower.
    lower = {"l_clavicle_x": np.deg2rad(6.0), "r_clavicle_x": np.deg2rad(-6.0)}
    raised = {name: angle + lower.get(name, 0.0) for name, angle in angles.items()}
    np.testing.assert_allclose(
        markers(mine, posture(mine, angles)), markers(published, posture(published, raised)),
        atol=1e-12,
    )  # fmt: skip


def test_the_prior_sd_of_poses() -> None:
    """Weak beliefs of refinement: none about the root, tight ones for clavicles and thorax."""

    def of(name):
        return BODY.prior_sd[BODY.index(name)]

    assert np.isinf(BODY.prior_sd[BODY.root]).all()
    tight = ("l_clavicle_x", "r_clavicle_y", "thorax_y", "thorax_z")
    assert [of(n) for n in tight] == [0.15] * 4
    assert [of(f"head_{a}") for a in "xyz"] == [0.3] * 3
    assert of("l_knee") == of("r_shoulder_x") == 0.6
    # The rotation of a limb about itself, which straight limbs do not show, varies less.
    assert of("l_hip_z") == of("r_hip_z") == 0.25 and of("l_shoulder_z") == 0.5


# --- cones --------------------------------------------------------------------------------------


def test_22_cones_with_hands_and_feet() -> None:
    middle = {"pelvis", "belly", "chest", "neck", "face", "crown"}
    limbs = {"deltoid", "upper_arm", "forearm", "hand", "thigh", "calf", "shin", "foot"}
    assert set(NAMES) == middle | {f"{side}_{limb}" for side in "lr" for limb in limbs}
    assert len(NAMES) == 22
    assert (BODY.cone_shape[:, :, :2] > 0.01).all() and (BODY.cone_shape[:, :, :2] < 0.2).all()


def mirrored(points):
    return points * [1.0, -1.0, 1.0]


def surface(body, pose, c):
    """Points (n, 3) on both ends of a cone, in a fixed order round its axis; and mirrored order."""
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    place = cone_transforms(body, pose)[c]
    points = []
    for e in range(2):
        rx, ry, ox, oy = body.cone_shape[c, e]
        z = np.full(angle.size, e * body.cone_length[c])
        flat = np.column_stack([ox + rx * np.cos(angle), oy + ry * np.sin(angle), z])
        points.append(flat @ place[:, :3].T + place[:, 3])
    return np.concatenate(points)


def same_set(a, b) -> bool:
    return bool((np.linalg.norm(a[:, None] - b[None], axis=2).min(axis=1) < 1e-9).all())


def test_neutral_is_symmetric() -> None:
    """Every left cone is its right one's mirror image; those of the trunk are their own."""
    for c, name in enumerate(NAMES):
        other = cone({"l": "r_", "r": "l_"}[name[0]] + name[2:]) if name[1] == "_" else c
        ours = surface(BODY, BODY.neutral, c)
        assert same_set(ours, mirrored(surface(BODY, BODY.neutral, other))), name


def test_it_stands_upright_and_has_a_front() -> None:
    """x is forward, y left, z up; toes in front of the ankles, hands below the wrists."""
    at = {}
    for c, name in enumerate(NAMES):
        at[name] = surface(BODY, BODY.neutral, c)
    points = dict(zip(MARKER_NAMES, markers(BODY, BODY.neutral), strict=True))
    for side, sign in (("l", 1.0), ("r", -1.0)):
        letter = side.upper()
        toes = at[f"{side}_foot"][24:].mean(axis=0)
        assert toes[0] - points[f"{letter}Ankle"][0] > 0.10
        assert at[f"{side}_foot"][:, 2].min() < points[f"{letter}Ankle"][2] - 0.04
        assert at[f"{side}_hand"][24:].mean(axis=0)[2] < points[f"{letter}Wrist"][2] - 0.10
        assert sign * at[f"{side}_thigh"].mean(axis=0)[1] > 0.05
        assert np.ptp(at[f"{side}_foot"][:, 0]) > 0.2
    crown = at["crown"][:, 2].max()
    assert crown == pytest.approx(points["Head"][2], abs=0.03)
    # From sole to crown it is about as tall as the person.
    sole = min(at[f"{side}_foot"][:, 2].min() for side in "lr")
    assert crown - sole == pytest.approx(1.75, abs=0.08)
    # The face is in front of the neck's axis.
    assert at["face"].mean(axis=0)[0] - points["Neck"][0] > 0.01


def test_cones_of_a_limb_are_joined() -> None:
    """Where a calf ends its shin begins, with the same section."""
    for side in "lr":
        calf, shin = cone(f"{side}_calf"), cone(f"{side}_shin")
        placed = cone_transforms(BODY, BODY.neutral)
        end = placed[calf, :, 3] + placed[calf, :, 2] * BODY.cone_length[calf]
        np.testing.assert_allclose(end, placed[shin, :, 3], atol=1e-12)
        assert BODY.cone_length[calf] + BODY.cone_length[shin] == pytest.approx(
            BODY.lengths_m[f"{side}_calf"]
        )
        np.testing.assert_allclose(BODY.cone_shape[calf, 1], BODY.cone_shape[shin, 0])
    face, crown = cone("face"), cone("crown")
    np.testing.assert_allclose(BODY.cone_shape[face, 1], BODY.cone_shape[crown, 0])


def test_stature_scales_everything() -> None:
    small, tall = load_body("person31", 1.0), load_body("person31", 2.0)
    np.testing.assert_allclose(2 * small.cone_length, tall.cone_length)
    np.testing.assert_allclose(2 * small.cone_shape, tall.cone_shape)
    np.testing.assert_allclose(2 * small.marker_offset, tall.marker_offset)


def test_bodies_of_the_presets() -> None:
    assert TrackerConfig.from_mapping({}).body == "person32"
    assert TrackerConfig.from_mapping({}, preset="paper").body == "balan31"


# --- collisions ---------------------------------------------------------------------------------


def test_neutral_is_feasible() -> None:
    assert Feasibility(BODY, BODY.limits, "elliptic")(BODY.neutral[None]).all()


WITHOUT_LIMITS = np.tile([[-np.inf], [np.inf]], (1, 31))


def test_crossed_legs_are_infeasible() -> None:
    """Legs swung inwards: 30 mm of margin a side lets ankles touch, not pass."""
    rule = Feasibility(BODY, WITHOUT_LIMITS, "elliptic")
    crossed = clear = 0
    for angle in np.linspace(-0.3, 0.3, 61):
        pose = BODY.neutral.copy()
        pose[[BODY.index("l_hip_x"), BODY.index("r_hip_x")]] += angle, -angle
        at = dict(zip(MARKER_NAMES, markers(BODY, pose), strict=True))
        gap = at["LAnkle"][1] - at["RAnkle"][1]
        if -0.15 < gap < 0.0:
            crossed += 1
            assert not rule(pose[None])[0], gap
        if gap > 0.06:
            clear += 1
            assert rule(pose[None])[0], gap
    assert crossed >= 5 and clear >= 20


@pytest.mark.parametrize("side", "lr")
def test_a_forearm_inside_the_trunk_is_infeasible(side) -> None:
    rng = np.random.default_rng(3)
    poses = np.tile(BODY.neutral, (6000, 1))
    arm = BODY.subspaces[f"{side}_arm"]
    poses[:, arm] = rng.uniform(*BODY.limits[:, arm], (len(poses), arm.size))
    allowed = Feasibility(BODY, WITHOUT_LIMITS, "elliptic")(poses)
    wrist = MARKER_NAMES.index(f"{side.upper()}Wrist")
    inside = 0
    for pose, ok in zip(poses, allowed, strict=True):
        point = markers(BODY, pose)[wrist]
        for part in (cone("belly"), cone("chest")):
            place = cone_transforms(BODY, pose)[part]
            local = place[:, :3].T @ (point - place[:, 3])
            t = local[2] / BODY.cone_length[part]
            shape = (1.0 - t) * BODY.cone_shape[part, 0] + t * BODY.cone_shape[part, 1]
            deep = np.linalg.norm((local[:2] - shape[2:]) / shape[:2]) < 0.4
            if 0.2 < t < 0.8 and deep:
                inside += 1
                assert not ok
    assert inside >= 3
    assert allowed.mean() > 0.5


@pytest.mark.parametrize("name", ["render_walk", "balance_real"])
def test_fitted_reference_poses_are_feasible(name, request) -> None:
    """The default limits and rule allow the pose of every 10th row of the reference."""
    track = read_trc(request.getfixturevalue(name) / "ground_truth.trc")
    rows = np.flatnonzero(track.tracked)[::10]
    named = [dict(zip(track.names, track.positions_m[row], strict=True)) for row in rows]
    body = load_body("person31", subject_from_markers(DESCRIPTION, named[0]))
    poses = np.array([pose_from_markers(body, points) for points in named])
    assert Feasibility(body, body.limits, "elliptic")(poses).all()
    assert len(poses) >= 10


# --- subject files --------------------------------------------------------------------------------


def test_a_subject_file_with_cones_gives_the_same_body(tmp_path) -> None:
    rng = np.random.default_rng(0)
    lengths = subject_from_stature(DESCRIPTION, 1.81).lengths_m
    generic = load_body("person31", 1.81)
    shapes = {
        name: generic.cone_shape[c] * rng.uniform(0.8, 1.2, (2, 4)) for c, name in enumerate(NAMES)
    }
    subject = Subject("me", lengths, shapes)
    write_subject(tmp_path / "me.yaml", subject)
    body = load_body("person31", read_subject(tmp_path / "me.yaml"))
    written = load_body("person31", subject)
    np.testing.assert_array_equal(body.cone_shape, written.cone_shape)
    np.testing.assert_array_equal(body.cone_length, written.cone_length)
    for c, name in enumerate(NAMES):
        np.testing.assert_array_equal(body.cone_shape[c], shapes[name])


def test_hands_and_feet_follow_the_stature_that_markers_imply() -> None:
    tall = load_body("person31", 1.9)
    points = dict(zip(MARKER_NAMES, markers(tall, tall.neutral), strict=True))
    lengths = subject_from_markers(DESCRIPTION, points).lengths_m
    assert lengths["hand"] == pytest.approx(0.104 * 1.9)
    assert lengths["foot"] == pytest.approx(0.142 * 1.9)
