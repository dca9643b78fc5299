"""The shipped 31-parameter body against the published table."""

import numpy as np
import pytest

from markerless_tracker.body import Feasibility, load_body
from markerless_tracker.errors import BodyModelError

BODY = load_body("balan31")

# x1..x31: name, sigma, least, most; mm and rad as published, None = free.
TABLE = (
    ("pelvis_rx", 0.01134, -0.2054, 0.2031),
    ("pelvis_ry", 0.00592, -0.0412, 0.1923),
    ("pelvis_rz", 0.05784, None, None),
    ("pelvis_tx", 13.7279, None, None),
    ("pelvis_ty", 17.1870, None, None),
    ("pelvis_tz", 2.3795, 838.0, 919.9),
    ("l_hip_x", 0.02295, -0.1656, 0.3124),
    ("l_hip_y", 0.04465, -0.5220, 0.7029),
    ("l_hip_z", 0.03691, -0.4066, 0.4522),
    ("l_knee", 0.09281, -1.4434, 0.4701),
    ("r_hip_x", 0.04540, -0.3246, 0.3176),
    ("r_hip_y", 0.03986, -0.4622, 0.5566),
    ("r_hip_z", 0.04724, -0.7667, 0.0133),
    ("r_knee", 0.07538, -1.2132, 0.4040),
    ("l_clavicle_x", 0.00304, 0.1437, 0.2664),
    ("l_clavicle_y", 0.00534, -0.0944, 0.0571),
    ("l_shoulder_x", 0.01692, 0.1073, 0.5009),
    ("l_shoulder_y", 0.02966, -2.0021, -0.9797),
    ("l_shoulder_z", 0.03596, -0.7000, 0.3492),
    ("l_elbow", 0.05111, -1.5911, -0.1739),
    ("r_clavicle_x", 0.00458, -0.1565, -0.0657),
    ("r_clavicle_y", 0.00480, -0.2036, -0.0777),
    ("r_shoulder_x", 0.01545, 0.0498, 0.3872),
    ("r_shoulder_y", 0.03936, 0.9256, 2.2730),
    ("r_shoulder_z", 0.05691, 2.4675, 3.8350),
    ("r_elbow", 0.04539, -1.2457, -0.1404),
    ("thorax_y", 0.00821, -0.2081, 0.0260),
    ("thorax_z", 0.03334, -0.3775, 0.4026),
    ("head_x", 0.01329, -0.1960, 0.5511),
    ("head_y", 0.01109, -0.7367, -0.0354),
    ("head_z", 0.03413, -0.8293, 1.0263),
)


def test_parameters_stand_in_the_published_order() -> None:
    assert BODY.parameter_names == tuple(row[0] for row in TABLE)
    assert BODY.size == 31 and len(BODY.cone_names) == 10


@pytest.mark.parametrize(("name", "sigma", "least", "most"), TABLE)
def test_sigma_and_walking_limits_are_the_published_ones(name, sigma, least, most) -> None:
    unit = 0.001 if name in ("pelvis_tx", "pelvis_ty", "pelvis_tz") else 1.0
    i = BODY.index(name)
    assert BODY.sigma[i] == pytest.approx(sigma * unit, rel=1e-12)
    expected = [-np.inf, np.inf] if least is None else [least * unit, most * unit]
    np.testing.assert_allclose(BODY.walking_limits[:, i], expected, rtol=1e-12)


def test_default_limits_are_anatomical() -> None:
    def degrees(name):
        i = BODY.index(name)
        return np.rad2deg(BODY.limits[:, i] - BODY.neutral[i])

    assert np.isinf(BODY.limits[:, BODY.root]).all()
    assert np.isfinite(BODY.limits[:, BODY.joints]).all()
    for side in "lr":
        np.testing.assert_allclose(degrees(f"{side}_knee"), [-155, 5])
        np.testing.assert_allclose(degrees(f"{side}_elbow"), [-155, 5])
        for axis in "xy":
            np.testing.assert_allclose(degrees(f"{side}_clavicle_{axis}"), [-45, 45])
        for twist in (f"{side}_hip_z", f"{side}_shoulder_z"):
            np.testing.assert_allclose(degrees(twist), [-90, 90])
        # Flexion 120 and extension 30 degrees, 20 more of slack.
        np.testing.assert_allclose(degrees(f"{side}_hip_y"), [-50, 140])
    # Forward, the left arm swings with the negative sign, the right one with the positive.
    np.testing.assert_allclose(degrees("l_shoulder_y"), [-200, 80])
    np.testing.assert_allclose(degrees("r_shoulder_y"), [-80, 200])
    for name in ("thorax_y", "thorax_z", "head_x", "head_y", "head_z"):
        np.testing.assert_allclose(degrees(name), [-50, 50])


def test_neutral_is_feasible_by_default() -> None:
    for rule in ("elliptic", "published"):
        assert Feasibility(BODY, BODY.limits, rule)(BODY.neutral[None]).all()


def test_subspaces_partition_the_parameters() -> None:
    parts = {step[0]: BODY.subspaces[step[0]] for step in BODY.steps("six")}
    assert sorted(np.concatenate(list(parts.values()))) == list(range(31))
    sizes = {name: len(part) for name, part in parts.items()}
    assert sizes == {"root": 6, "torso_head": 5, "l_arm": 6, "r_arm": 6, "l_leg": 4, "r_leg": 4}


def test_cones_have_the_sample_subjects_proportions() -> None:
    """Radii over length of the published sample subject (mm)."""
    published = {
        "torso": (160 * 0.884, 160, 160 * 0.884, 160, 579),
        "head": (108, 108 * 0.74, 108, 108 * 0.74, 268),
        "l_upper_arm": (60, 60, 40, 40, 206),
        "r_upper_arm": (60, 60, 40, 40, 243),
        "l_forearm": (40, 40, 30, 30, 220),
        "r_forearm": (40, 40, 30, 30, 248),
        "l_thigh": (90, 90, 80, 80, 425),
        "r_thigh": (90, 90, 80, 80, 394),
        "l_calf": (80, 80, 80, 80, 449),
        "r_calf": (80, 80, 80, 80, 465),
    }
    for i, name in enumerate(BODY.cone_names):
        *radii, length = published[name]
        ratios = BODY.cone_shape[i, :, :2].ravel() / BODY.cone_length[i]
        np.testing.assert_allclose(ratios, np.array(radii) / length, atol=1e-4, err_msg=name)
        assert not BODY.cone_shape[i, :, 2:].any()


def test_the_head_has_no_edges() -> None:
    """Sides of every cone but the head's, and the upper edge of the torso."""
    for name, (sides, top) in zip(BODY.cone_names, BODY.cone_edges, strict=True):
        assert sides == (name != "head") and top == (name == "torso")


def test_collision_pairs_are_the_published_ones() -> None:
    pairs = {frozenset(BODY.cone_names[i] for i in pair) for pair in BODY.collisions}
    assert pairs == {
        frozenset(("l_forearm", "torso")),
        frozenset(("r_forearm", "torso")),
        frozenset(("l_calf", "r_calf")),
    }


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        BODY.limits[0, 0] = 1.0


def test_unknown_parameter_is_named() -> None:
    with pytest.raises(BodyModelError, match="balan31 has no parameter 'l_toe'"):
        BODY.index("l_toe")


def test_stature_scales_everything() -> None:
    small, tall = load_body("balan31", 1.0), load_body("balan31", 2.0)
    np.testing.assert_allclose(2 * small.cone_length, tall.cone_length)
    np.testing.assert_allclose(2 * small.cone_shape, tall.cone_shape)
    np.testing.assert_allclose(2 * small.marker_offset, tall.marker_offset)
