"""Sections and offsets of the cones from silhouettes, the pose known."""

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body
from markerless_tracker.body.anatomy import posture
from markerless_tracker.camera import CameraRig
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.fitness.shape.section_fit import fit_shape, shape_fitting, unfitted
from markerless_tracker.fitness.shape.sections import (
    CLOTHED_PARTS,
    OFFSET_RANGE_M,
    RADIUS_RANGE,
)
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

GENERIC = load_body("person31", 1.75)
RIG = ring_rig(4, (656, 490))
NAMES = GENERIC.cone_names
LEFT = [i for i, name in enumerate(NAMES) if name.startswith("l_")]
RIGHT = [NAMES.index("r_" + NAMES[i][2:]) for i in LEFT]
HANDS = [NAMES.index("l_hand"), NAMES.index("r_hand")]
MIDDLE = [i for i, name in enumerate(NAMES) if name[:2] not in ("l_", "r_")]


def open_pose(seed) -> FloatArray:
    """Limbs apart and bent, in any rotation."""
    rng = np.random.default_rng(seed)
    apart = {f"{side}_shoulder_x": 0.7 for side in "lr"} | {f"{s}_hip_x": 0.25 for s in "lr"}
    pose = posture(GENERIC, apart)
    pose[GENERIC.joints] += rng.uniform(-0.15, 0.15, GENERIC.joints.size)
    at = {name: i for i, name in enumerate(GENERIC.parameter_names)}
    pose[[at["pelvis_rz"], at["pelvis_tz"]]] = rng.uniform(-3.0, 3.0), 0.95
    for side in "lr":
        pose[at[f"{side}_knee"]], pose[at[f"{side}_elbow"]] = -0.5, -0.8
    return pose


def random_person(seed, *, alike=True) -> BodyModel:
    """A person whose sections differ from the generic ones by up to 25 % and 15 mm."""
    rng = np.random.default_rng(seed)
    shape = GENERIC.cone_shape.copy()
    shape[:, :, :2] *= rng.uniform(0.8, 1.25, shape[:, :, :2].shape)
    shape[:, :, 2:] += rng.uniform(-0.015, 0.015, shape[:, :, 2:].shape)
    if alike:
        shape[MIDDLE, :, 3] = 0.0
        shape[RIGHT] = shape[LEFT] * [1.0, 1.0, 1.0, -1.0]
    return replace(GENERIC, cone_shape=shape)


@dataclass(frozen=True, eq=False)
class Seen:
    """Evidence of a body at a pose in all cameras of the rig."""

    pose: FloatArray
    observations: dict[str, Observation]
    rig: CameraRig = RIG

    def frame(self, body=GENERIC) -> ContourFrame:
        return ContourFrame(
            body,
            {camera.name: camera for camera in self.rig},
            self.observations,
            Fitness(body, self.rig.cameras).lay_out(self.observations),
            pixels_per_m={camera.name: camera.matrix[0, 0] / 4.5 for camera in self.rig},
        )

    def f_s(self, body) -> float:
        fitness = Fitness(body, self.rig.cameras)
        terms = fitness.terms(fitness.lay_out(self.observations), self.pose)
        return float(np.mean([t.silhouette for t in terms.values()]))


def seen(body, pose, change=lambda mask: mask) -> Seen:
    observations = {}
    for camera in RIG:
        mask = change(silhouette(body, pose, camera).astype(np.uint8))
        observations[camera.name] = Observation.from_mask(
            camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
        )
    return Seen(pose, observations)


@pytest.fixture(scope="module", params=[0, 1])
def case(request) -> tuple[BodyModel, Seen, BodyModel]:
    """A person, the evidence of that person, and the fitted body."""
    true = random_person(request.param)
    view = seen(true, open_pose(request.param))
    return true, view, fit_shape(GENERIC, [(view.frame(), view.pose)])


# --- the fit --------------------------------------------------------------------------------


def test_a_known_shape_is_recovered(case) -> None:
    true, view, fitted = case
    assert view.f_s(GENERIC) < 0.96
    assert view.f_s(fitted) > 0.985
    error = np.abs(fitted.cone_shape - true.cone_shape) * 1000.0
    before = np.abs(GENERIC.cone_shape - true.cone_shape) * 1000.0
    # Only ends inside other parts are invisible.
    radii, offsets = error[:, :, :2], error[:, :, 2:]
    assert radii.mean() < 4.0 < 7.0 < before[:, :, :2].mean()
    assert np.quantile(radii, 0.75) < 5.4
    assert offsets.mean() < 3.0 and np.quantile(offsets, 0.9) < 6.0


def test_the_contours_cost_falls_to_the_true_shapes(case) -> None:
    true, view, fitted = case
    frame = view.frame()
    costs = []
    for body in (None, true, fitted, None):
        frame.collect(view.pose, 0.1, body)
        costs.append(frame.residuals.cost.sum())
    generic, least, found, again = costs
    assert found - least < 0.15 * (generic - least)
    # The frame keeps its own, generic body.
    assert again == generic


def test_the_place_of_heel_and_toes_is_found() -> None:
    """Of upright feet: 12 mm shorter, and 10 mm farther back, than generic ones."""
    generic = load_body("person32", 1.75)
    feet = [generic.cone_names.index(f"{side}_foot") for side in "lr"]
    shape = generic.cone_shape.copy()
    shape[feet, :, 0] -= 0.006
    shape[feet, :, 2] += 0.010
    true = replace(generic, cone_shape=shape)
    apart = {f"{side}_hip_x": 0.2 for side in "lr"} | {f"{side}_shoulder_x": 0.7 for side in "lr"}
    view = seen(true, posture(generic, apart | {"pelvis_rz": 0.4, "pelvis_tz": 0.95}))
    fitted = fit_shape(generic, [(view.frame(generic), view.pose)])

    def heel_and_toe_m(body) -> FloatArray:
        radius, ahead = body.cone_shape[feet, 1, 0], body.cone_shape[feet, 1, 2]
        return np.array([ahead + radius, ahead - radius])

    expected, found = heel_and_toe_m(true), heel_and_toe_m(fitted)
    np.testing.assert_allclose(found, expected, atol=0.004)
    assert np.abs(heel_and_toe_m(generic) - expected).max() > 0.012


def alike(limbs) -> FloatArray:
    """Sections of limbs, without the offsets of the hand, which depend on its wrist."""
    out = limbs.copy()
    out[LEFT.index(HANDS[0]), :, 2:] = 0.0
    return out


def test_each_hand_lies_where_its_wrist_holds_it() -> None:
    """One hand bent inward by 15 degrees, the other straight; the forearms stay alike."""
    shape = GENERIC.cone_shape.copy()
    end = 0.26 * GENERIC.cone_length[HANDS[0]]
    shape[HANDS[0], 1, 3] += end
    view = seen(replace(GENERIC, cone_shape=shape), open_pose(2))
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)]).cone_shape - GENERIC.cone_shape
    assert fitted[HANDS[0], 1, 3] > 0.6 * end
    assert abs(fitted[HANDS[1], 1, 3]) < 0.2 * end
    forearm = NAMES.index("l_forearm")
    assert np.abs(fitted[forearm, :, 2:]).max() < 0.005


def test_left_and_right_are_equal_and_the_trunk_symmetric(case) -> None:
    fitted = case[2].cone_shape
    np.testing.assert_array_equal(alike(fitted[RIGHT]), alike(fitted[LEFT] * [1, 1, 1, -1]))
    assert not fitted[MIDDLE, :, 3].any()
    assert (np.abs(fitted[LEFT, :, 3]) > 1e-4).any()


def test_sides_that_differ_are_averaged() -> None:
    """A left calf 20 % thicker, a right one 20 % thinner: the average is the generic one."""
    shape = GENERIC.cone_shape.copy()
    for side, factor in (("l", 1.2), ("r", 0.8)):
        for part in ("calf", "shin"):
            shape[NAMES.index(f"{side}_{part}"), :, :2] *= factor
    view = seen(replace(GENERIC, cone_shape=shape), open_pose(2))
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)]).cone_shape
    np.testing.assert_array_equal(alike(fitted[RIGHT]), alike(fitted[LEFT] * [1, 1, 1, -1]))
    shin = NAMES.index("l_shin")
    np.testing.assert_allclose(
        fitted[shin, :, :2].mean(), GENERIC.cone_shape[shin, :, :2].mean(), rtol=0.05
    )


@pytest.mark.parametrize("grow", [True, False], ids=["swollen", "shrunken"])
def test_bounds_are_kept(grow) -> None:
    """Silhouettes of a person 80 mm thicker everywhere, or of a skeleton."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (25, 25) if grow else (9, 9))
    view = seen(GENERIC, open_pose(3), lambda m: (cv2.dilate if grow else cv2.erode)(m, kernel))
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)], tightness=0.01).cone_shape
    ratio = fitted[:, :, :2] / GENERIC.cone_shape[:, :, :2]
    least, most = RADIUS_RANGE
    assert ratio.min() >= least * (1 - 1e-12) and ratio.max() <= most * (1 + 1e-12)
    assert (ratio > 1.2).mean() > 0.3 if grow else (ratio < 0.8).mean() > 0.2
    assert (ratio.max() > 0.999 * most) if grow else (ratio.min() < 1.001 * least)
    moved = fitted[:, :, 2:] - GENERIC.cone_shape[:, :, 2:]
    assert np.abs(moved).max() <= OFFSET_RANGE_M * (1 + 1e-12)


def clothed() -> FloatArray:
    """Sections of the prior's mean: wider trunk, head, upper arms and thighs, else generic."""
    shape = GENERIC.cone_shape.copy()
    wider = [i for i, name in enumerate(NAMES) if name.endswith(CLOTHED_PARTS)]
    shape[wider, :, :2] *= 1.15
    assert len(wider) == 9
    return shape


def test_empty_silhouettes_give_the_sections_of_clothed_people() -> None:
    view = seen(GENERIC, open_pose(4), np.zeros_like)
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)])
    np.testing.assert_allclose(fitted.cone_shape, clothed(), atol=1e-12)
    np.testing.assert_allclose(fitted.cone_length, GENERIC.cone_length)


def test_one_black_camera_does_not_matter() -> None:
    true = random_person(5)
    view = seen(true, open_pose(5))
    nothing = np.zeros((490, 656), np.uint8)
    dark = view.observations | {"cam02": Observation.from_mask("cam02", 0, nothing, nothing)}
    fitted = fit_shape(GENERIC, [(Seen(view.pose, dark).frame(), view.pose)])
    assert np.isfinite(fitted.cone_shape).all()
    assert view.f_s(fitted) > 0.97 > view.f_s(GENERIC)


def test_a_tight_prior_keeps_its_mean() -> None:
    view = seen(random_person(6), open_pose(6))
    frames = [(view.frame(), view.pose)]
    held, loose = (fit_shape(GENERIC, frames, tightness=t).cone_shape for t in (1e7, 1.0))
    np.testing.assert_allclose(held, clothed(), atol=1e-5)
    assert np.abs(loose - GENERIC.cone_shape).max() > 0.02


def test_frames_are_averaged() -> None:
    """The same frame twice gives the same fit as once; another frame changes it."""
    true = random_person(7)
    first, second = (seen(true, open_pose(seed)) for seed in (7, 8))
    frames = [(view.frame(), view.pose) for view in (first, second)]
    once, twice, both = (
        fit_shape(GENERIC, chosen).cone_shape for chosen in (frames[:1], frames[:1] * 2, frames)
    )
    np.testing.assert_allclose(twice, once, atol=1e-9)
    error = [np.abs(s - true.cone_shape)[:, :, :2].mean() for s in (GENERIC.cone_shape, both)]
    assert error[1] < 0.4 * error[0]
    assert np.abs(both - once).max() > 1e-3


def test_a_fit_goes_on_in_pieces_from_where_it_was() -> None:
    true = random_person(7)
    first, second = (seen(true, open_pose(seed)) for seed in (7, 8))
    frames = [(view.frame(), view.pose) for view in (first, second)]
    # A weight counts as so many frames.
    complete = fit_shape(GENERIC, [frames[0], *frames])
    weighted = [(*frames[0], 2.0), (*frames[1], 1.0)]
    fitting = shape_fitting(
        GENERIC, weighted, start=complete, iterations=3, truncation_m=(0.04, 0.04)
    )
    for _ in range(6):
        assert next(fitting) is None
    with pytest.raises(StopIteration) as end:
        next(fitting)
    # But for the hidden end of the neck.
    moved = np.quantile(np.abs(end.value.value.cone_shape - complete.cone_shape), 0.95)
    assert moved < 0.1 * np.abs(complete.cone_shape - GENERIC.cone_shape).max()


def test_only_sections_and_hands_change(case) -> None:
    fitted = case[2]
    for field in fields(BodyModel):
        if field.name not in ("cone_shape", "cone_length", "lengths_m"):
            assert getattr(fitted, field.name) is getattr(GENERIC, field.name)
    others = np.setdiff1d(np.arange(len(NAMES)), HANDS)
    np.testing.assert_array_equal(fitted.cone_length[others], GENERIC.cone_length[others])
    for name, length_m in GENERIC.lengths_m.items():
        assert name == "hand" or fitted.lengths_m[name] == length_m


@pytest.mark.parametrize("longer", [0.85, 1.18])
def test_the_length_of_the_hands_is_found(longer) -> None:
    """Of both hands in common; the named length follows, so that a subject file keeps it."""
    lengths_m = GENERIC.cone_length.copy()
    lengths_m[HANDS] *= longer
    view = seen(replace(GENERIC, cone_length=lengths_m), open_pose(2))
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)])
    np.testing.assert_allclose(fitted.cone_length[HANDS], lengths_m[HANDS], atol=0.005)
    assert fitted.cone_length[HANDS[0]] == fitted.cone_length[HANDS[1]]
    ratio = fitted.cone_length[HANDS[0]] / GENERIC.cone_length[HANDS[0]]
    assert fitted.lengths_m["hand"] == pytest.approx(ratio * GENERIC.lengths_m["hand"])
    assert type(fitted.lengths_m["hand"]) is float


def test_the_hands_can_be_left_alone() -> None:
    view = seen(random_person(2), open_pose(2))
    fitted = fit_shape(GENERIC, [(view.frame(), view.pose)], hands=False)
    assert fitted.cone_length is GENERIC.cone_length
    assert fitted.lengths_m is GENERIC.lengths_m


def test_a_fitted_body_becomes_generic_again(case) -> None:
    """All that was fitted; other lengths stay."""
    fitted = replace(case[2], marker_offset=2.0 * GENERIC.marker_offset)
    again = unfitted(fitted, GENERIC)
    np.testing.assert_allclose(again.cone_shape, GENERIC.cone_shape, atol=1e-15)
    np.testing.assert_allclose(again.cone_length, GENERIC.cone_length)
    assert again.lengths_m == pytest.approx(dict(GENERIC.lengths_m))
    assert again.marker_offset is fitted.marker_offset


def test_the_published_body_can_be_fitted_too() -> None:
    body = load_body("balan31", 1.75)
    true = replace(body, cone_shape=body.cone_shape * [1.15, 1.15, 1.0, 1.0])
    view = seen(true, open_pose(9))
    fitted = fit_shape(body, [(view.frame(body), view.pose)])
    assert view.f_s(body) < 0.95 < 0.985 < view.f_s(fitted)
