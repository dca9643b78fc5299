"""Lengths and sections from several frames with approximate poses."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.body import load_description, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.sizes import PROPORTION_SD, Sizes
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.shape.body_fit import LIMB_OFFSET_SD_RATIO, BodyFit
from markerless_tracker.fitness.shape.sections import OFFSET_SD_M, RADIUS_RANGE, Sections
from markerless_tracker.synthesis import ring_rig

SIZES = Sizes(load_description("person31"))
GENERIC = SIZES.of_stature(1.70)
LIMITS = GENERIC.limits
RIG = ring_rig(4, (656, 490))
FRAMES = 4


def person(seed):
    """A person of 1.80 m with longer and shorter parts, stouter or slimmer."""
    rng = np.random.default_rng(seed)
    lengths = SIZES.of(SIZES.of_stature(1.80))
    own = SIZES.body(lengths * np.exp(PROPORTION_SD * rng.uniform(-1.5, 1.5, lengths.size)))
    shape = own.cone_shape.copy()
    shape[:, :, :2] *= rng.uniform(0.85, 1.2)
    return replace(own, cone_shape=shape)


def poses(seed):
    """Poses (n, p) of a person moving all limbs."""
    rng = np.random.default_rng(seed)
    apart = {f"{side}_shoulder_x": 0.6 for side in "lr"} | {f"{s}_hip_x": 0.2 for s in "lr"}
    out = np.tile(posture(GENERIC, apart), (FRAMES, 1))
    out[:, GENERIC.joints] += rng.uniform(-0.25, 0.25, (FRAMES, GENERIC.joints.size))
    out[:, GENERIC.index("pelvis_tz")] = 1.0
    out[:, GENERIC.index("pelvis_rz")] = 0.4
    for side in "lr":
        out[:, GENERIC.index(f"{side}_knee")] = rng.uniform(-1.0, -0.2, FRAMES)
        out[:, GENERIC.index(f"{side}_elbow")] = rng.uniform(-1.2, -0.3, FRAMES)
    return out


@pytest.fixture(scope="module", params=[0, 1])
def fit(request, contours_of):
    """The person, the poses, and the fit after twelve iterations from disturbed poses."""
    true, moves = person(request.param), poses(request.param)
    rng = np.random.default_rng(request.param)
    fit = BodyFit(SIZES, GENERIC, SIZES.prior(None), LIMITS)
    for pose in moves:
        about = pose.copy()
        about[GENERIC.joints] += rng.normal(0.0, 0.08, GENERIC.joints.size)
        about[GENERIC.root[3:]] += rng.normal(0.0, 0.02, 3)
        fit.add(contours_of(true, pose, RIG, GENERIC), np.clip(about, *LIMITS))
    for truncation_m in np.geomspace(0.10, 0.035, 12):
        list(fit.pieces(truncation_m))
    return true, moves, fit


def test_lengths_approach_the_persons(fit) -> None:
    true, _, fitted = fit
    before = np.abs(np.log(SIZES.of(GENERIC) / SIZES.of(true)))
    after = np.abs(np.log(SIZES.of(fitted.body) / SIZES.of(true)))
    assert after.mean() < 0.6 * before.mean()
    assert after.mean() < 0.035


def test_joints_approach_the_persons(fit) -> None:
    """Errors of lengths, sections and poses that compensate each other do not move the joints."""
    true, moves, fitted = fit
    gaps = [
        np.linalg.norm(markers(fitted.body, pose) - markers(true, move), axis=1).mean()
        for pose, move in zip(fitted.poses, moves, strict=True)
    ]
    assert max(gaps) < 0.025


def test_both_sides_stay_equal_and_all_bounds_are_kept(fit) -> None:
    _, _, fitted = fit
    body = fitted.body
    for name, value in body.lengths_m.items():
        if name.startswith("l_"):
            assert body.lengths_m["r_" + name[2:]] == value
    left = [i for i, name in enumerate(body.cone_names) if name.startswith("l_")]
    right = [body.cone_names.index("r_" + body.cone_names[i][2:]) for i in left]
    mirrored = body.cone_shape[left] * [1.0, 1.0, 1.0, -1.0]
    # The offsets of the hands depend on their wrists.
    hand = left.index(body.cone_names.index("l_hand"))
    mirrored[hand, :, 2:] = body.cone_shape[right[hand], :, 2:]
    np.testing.assert_allclose(body.cone_shape[right], mirrored)
    ratio = body.cone_shape[:, :, :2] / GENERIC.cone_shape[:, :, :2]
    assert ratio.min() >= RADIUS_RANGE[0] - 1e-9 and ratio.max() <= RADIUS_RANGE[1] + 1e-9
    assert (fitted.poses >= LIMITS[0]).all() and (fitted.poses <= LIMITS[1]).all()


def test_without_evidence_the_prior_remains(contours_of) -> None:
    """Without evidence lengths and sections move to the prior mean."""
    fit = BodyFit(SIZES, SIZES.of_stature(1.9), SIZES.prior(None), LIMITS)
    list(fit.pieces(0.1))
    list(fit.pieces(0.1))
    np.testing.assert_allclose(SIZES.of(fit.body), SIZES.of(GENERIC), rtol=1e-3)
    sections = Sections(SIZES.of_stature(1.9))
    np.testing.assert_allclose(sections.of(fit.body), sections.prior_mean, rtol=1e-9)


def test_a_frame_without_silhouettes_changes_nothing(contours_of) -> None:
    pose = poses(0)[0]
    away = pose.copy()
    away[GENERIC.index("pelvis_tx")] = 500.0
    fit = BodyFit(SIZES, GENERIC, SIZES.prior(None), LIMITS)
    fit.add(contours_of(GENERIC, away, RIG, GENERIC), pose)
    for _ in range(3):
        list(fit.pieces(0.1))
    np.testing.assert_allclose(SIZES.of(fit.body), SIZES.of(GENERIC), rtol=1e-6)
    np.testing.assert_allclose(fit.poses[0, GENERIC.root], pose[GENERIC.root], atol=1e-6)


def test_equations_that_are_not_finite_change_nothing(contours_of) -> None:
    fit = BodyFit(SIZES, GENERIC, SIZES.prior(None), LIMITS)
    pose = poses(0)[0]
    frame = contours_of(GENERIC, pose, RIG, GENERIC)
    fit.add(frame, np.where(np.arange(pose.size) == 3, np.nan, pose))
    before = SIZES.of(fit.body)
    list(fit.pieces(0.1))
    np.testing.assert_array_equal(SIZES.of(fit.body), before)


def test_a_given_stature_restrains_the_lengths(contours_of) -> None:
    """A given 1.60 m for a person of 1.80 m: the lengths grow, by less than without a stature."""
    true, moves = person(0), poses(0)[:2]
    sizes = []
    for stature in (1.60, None):
        fit = BodyFit(SIZES, SIZES.of_stature(1.60), SIZES.prior(stature), LIMITS)
        for pose in moves:
            fit.add(contours_of(true, pose, RIG, GENERIC), pose)
        for truncation_m in np.geomspace(0.10, 0.035, 6):
            list(fit.pieces(truncation_m))
        sizes.append(np.log(SIZES.of(fit.body)).mean())
    given = np.log(SIZES.of(SIZES.of_stature(1.60))).mean()
    assert given < sizes[0] < sizes[1] - 0.01


def error_m(frames, contours_of, true, rig, *, varied):
    """The mean distance of markers (m) after a fit; silhouettes are those of another rig."""
    fit = BodyFit(SIZES, GENERIC, SIZES.prior(None), LIMITS, varied=varied)
    for pose in frames:
        seen = contours_of(true, pose, RIG, GENERIC)
        seen.contours = contours_of(true, pose, rig, GENERIC).contours
        fit.add(seen, pose)
    for truncation_m in np.geomspace(0.10, 0.05, 8):
        list(fit.pieces(truncation_m))
    gaps = [
        np.linalg.norm(markers(fit.body, found) - markers(true, pose), axis=1).mean()
        for found, pose in zip(fit.poses, frames, strict=True)
    ]
    return float(np.mean(gaps))


def test_a_camera_that_disagrees_counts_less_where_poses_vary(contours_of) -> None:
    """One of four cameras is calibrated 6 px off, 45 mm at the body."""
    first, *others = RIG.cameras
    matrix = first.matrix.copy()
    matrix[0, 2] += 6.0
    wrong = CameraRig((replace(first, matrix=matrix), *others))
    true, moves = person(0), poses(0)[:3]
    alike, less = (
        error_m(moves, contours_of, true, wrong, varied=varied) for varied in (False, True)
    )
    assert less < 0.7 * alike


def test_flesh_of_limbs_keeps_nearer_to_their_joints() -> None:
    """In proportion to the limb, but for hands, which lie where their wrists hold them."""
    sections = Sections(GENERIC, LIMB_OFFSET_SD_RATIO)
    sd = sections.put(GENERIC, sections.prior_sd).cone_shape
    for c, name in enumerate(GENERIC.cone_names):
        limb = name[:2] in ("l_", "r_") and not name.endswith("hand")
        radii = GENERIC.cone_shape[c, :, :2].mean(axis=1)
        expected = LIMB_OFFSET_SD_RATIO * radii if limb else np.full(2, OFFSET_SD_M)
        np.testing.assert_allclose(sd[c, :, 2], expected, err_msg=name)
    plain = Sections(GENERIC)
    np.testing.assert_allclose(plain.put(GENERIC, plain.prior_sd).cone_shape[:, :, 2], OFFSET_SD_M)
