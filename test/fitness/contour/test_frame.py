"""Pose refinement on contours from end to end."""

from dataclasses import dataclass

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.camera import CameraRig
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour.frame import SPACING_M, ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import Prior, refine
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig

PRECISION = 1.0 / (0.05 * 0.010**2)
"""Of 10 mm of noise in pieces of outline 50 mm long."""
LENS = (-0.15, 0.06, 0.002, -0.0015, 0.01)


@dataclass(frozen=True, eq=False)
class Person:
    """A body, its true pose, and the evidence of four cameras."""

    body: BodyModel
    rig: CameraRig
    pose: FloatArray
    observations: dict[str, Observation]

    def frame(self, *, black=(), cameras=None, body=None) -> ContourFrame:
        body, cameras = body or self.body, cameras or self.rig.cameras
        names = {camera.name for camera in cameras}
        seen = {name: view for name, view in self.observations.items() if name in names}
        for name in black:
            nothing = np.zeros_like(seen[name].edges)
            seen[name] = Observation.from_mask(name, 0, nothing, nothing)
        return ContourFrame(
            body,
            {camera.name: camera for camera in cameras},
            seen,
            Fitness(body, cameras).lay_out(seen),
            pixels_per_m={camera.name: camera.matrix[0, 0] / 4.5 for camera in cameras},
        )

    def start(self, seed, *, offset_m=0.06, turn_rad=0.15) -> tuple[FloatArray, Prior]:
        """A disturbed pose, the root somewhere within `offset_m`, and the belief in it."""
        moved = np.isin(np.arange(self.body.size), self.body.root[3:])
        most = np.where(moved, offset_m / np.sqrt(3.0), turn_rad)
        change = np.random.default_rng(seed).uniform(-most, most)
        pose = np.clip(self.pose + change, *self.body.limits)
        return pose, Prior(pose, 1.0 / most**2)

    def error_mm(self, pose) -> float:
        gap = markers(self.body, pose) - markers(self.body, self.pose)
        return float(np.linalg.norm(gap, axis=1).mean() * 1000.0)


_APART = {"shoulder": 0.7, "hip": 0.2}


def person(name, seed, **angles) -> Person:
    """Limbs apart and bent, in any rotation; named angles (rad) replace drawn ones."""
    body = load_body(name, 1.75)
    rng = np.random.default_rng(seed)
    apart = {f"{side}_{joint}_x": by for side in "lr" for joint, by in _APART.items()}
    pose = posture(body, apart)
    pose[body.joints] += rng.uniform(-0.15, 0.15, body.joints.size)
    pose[[body.index("pelvis_rz"), body.index("pelvis_tz")]] = rng.uniform(-3.0, 3.0), 0.95
    for side in "lr":
        pose[body.index(f"{side}_knee")] = rng.uniform(-0.9, -0.3)
        pose[body.index(f"{side}_elbow")] = rng.uniform(-1.2, -0.5)
    for key, value in angles.items():
        pose[body.index(key)] = value
    rig = ring_rig(4, (656, 490), distortion=LENS)
    seen = {}
    for camera in rig:
        mask = silhouette(body, pose, camera)
        seen[camera.name] = Observation.from_mask(
            camera.name, 0, mask, np.zeros(mask.shape, np.uint8)
        )
    return Person(body, rig, pose, seen)


def refined(shown: Person, frame: ContourFrame, start: FloatArray, prior: Prior, iterations=12):
    return frame.refined(
        start, precision=PRECISION, priors=(prior,), bounds=shown.body.limits,
        iterations=iterations, truncation_m=(0.2, 0.03),
    )  # fmt: skip


def refined_slowly(
    shown: Person, frame: ContourFrame, start: FloatArray, priors: tuple[Prior, ...]
):
    """The same by `optim.refine`, with NumPy's solution of each step."""

    def equations(pose, truncation_m):
        sums = frame.equations(pose, truncation_m)
        return sums.hessian * PRECISION, sums.gradient * PRECISION

    return refine(
        equations, start, priors=priors, bounds=shown.body.limits, iterations=5,
        truncation=(0.2, 0.03),
    )  # fmt: skip


@pytest.mark.parametrize("beliefs", [0, 1, 2])
def test_the_compiled_refinement_is_the_written_one(beliefs) -> None:
    """Whatever the number of priors; the start lies on some limits."""
    shown = person("person31", 3)
    start, prior = shown.start(7)
    start[shown.body.index("l_knee")] = 0.1
    priors = (prior, Prior(shown.pose, np.full(start.size, 4.0)))[:beliefs]
    slow = refined_slowly(shown, shown.frame(), start, priors)
    fast = shown.frame().refined(
        start, precision=PRECISION, priors=priors, bounds=shown.body.limits, iterations=5,
        truncation_m=(0.2, 0.03),
    )  # fmt: skip
    np.testing.assert_allclose(fast, slow, atol=1e-9)
    assert shown.error_mm(fast) < 0.5 * shown.error_mm(start)


@pytest.mark.parametrize("name", ["balan31", "person31"])
@pytest.mark.parametrize("seed", range(4))
def test_a_disturbed_pose_is_recovered(name, seed) -> None:
    shown = person(name, seed)
    start, prior = shown.start(100 + seed)
    found = refined(shown, shown.frame(), start, prior)
    assert shown.error_mm(start) > 70.0
    assert shown.error_mm(found) < 6.0


def test_a_small_disturbance_needs_few_iterations() -> None:
    shown = person("person31", 0)
    start, prior = shown.start(5, offset_m=0.02, turn_rad=0.05)
    found = refined(shown, shown.frame(), start, prior, iterations=4)
    assert shown.error_mm(start) > 20.0 and shown.error_mm(found) < 3.0


def test_fewer_outline_points_lead_nearly_to_the_same_pose() -> None:
    """Each point counts for the length that it stands for."""
    shown, counts, found = person("person31", 1), [], []
    start, prior = shown.start(101)
    for spacing_m in (SPACING_M, 2.0 * SPACING_M):
        frame = shown.frame()
        pose = frame.refined(
            start, precision=PRECISION, priors=(prior,), bounds=shown.body.limits, iterations=12,
            truncation_m=(0.2, 0.03), spacing_m=spacing_m,
        )  # fmt: skip
        counts.append(int(frame.residuals.count.sum()))
        found.append(pose)
        assert shown.error_mm(pose) < 8.0
    assert counts[1] < 0.8 * counts[0]
    assert not np.array_equal(*found)


def test_some_views_seen_by_other_cameras_are_as_if_made_for_them() -> None:
    """With another body's shape, too; the frame itself does not change."""
    shown = person("person31", 2)
    body, frame = load_body("person31", 1.9), shown.frame()
    cameras = [shown.rig.shifted({"cam02": (9.0, -4.0)})["cam02"], shown.rig["cam04"]]
    before = frame.equations(shown.pose, 0.1)
    made, seen = shown.frame(cameras=cameras, body=body), frame.seen_by(cameras, body)
    start, prior = shown.start(3)
    np.testing.assert_array_equal(
        refined(shown, seen, start, prior), refined(shown, made, start, prior)
    )
    ours, theirs = seen.equations(start, 0.1), made.equations(start, 0.1)
    np.testing.assert_array_equal(ours.hessian, theirs.hessian)
    assert ours.cost == theirs.cost
    seen.views.arrays.intrinsics[:] = 0.0
    assert frame.equations(shown.pose, 0.1).cost == before.cost


def test_a_refinement_can_be_repeated() -> None:
    shown = person("person31", 1)
    start, prior = shown.start(1)
    once, again = (refined(shown, shown.frame(), start, prior) for _ in range(2))
    assert once.tobytes() == again.tobytes()


@pytest.mark.parametrize("joint", ["l_elbow", "r_elbow", "l_knee", "r_knee"])
@pytest.mark.parametrize("beyond", [0.0, 0.3])
def test_limits_are_kept(joint, beyond) -> None:
    """A limb straight up to its limit, or bent beyond it."""
    body = load_body("person31", 1.75)
    most = body.limits[1, body.index(joint)]
    shown = person("person31", 2, **{joint: most + beyond})
    start, prior = shown.start(3, offset_m=0.03, turn_rad=0.1)
    found = refined(shown, shown.frame(), start, prior)
    assert (found >= body.limits[0]).all() and (found <= body.limits[1]).all()
    at = found[body.index(joint)]
    assert at == most if beyond else at > most - 0.1
    assert shown.error_mm(found) < (25.0 if beyond else 5.0)


def test_a_black_camera_does_not_matter() -> None:
    shown = person("person31", 3)
    start, prior = shown.start(4, offset_m=0.03, turn_rad=0.08)
    found = refined(shown, shown.frame(black=["cam02"]), start, prior)
    assert np.isfinite(found).all()
    assert shown.error_mm(found) < 10.0


def test_all_cameras_black_leaves_the_start() -> None:
    shown = person("balan31", 4)
    start, prior = shown.start(5)
    found = refined(shown, shown.frame(black=shown.rig.names), start, prior)
    np.testing.assert_allclose(found, start, atol=1e-12)


def test_a_missing_camera() -> None:
    shown = person("person31", 5)
    del shown.observations["cam03"]
    start, prior = shown.start(6, offset_m=0.03, turn_rad=0.08)
    assert shown.error_mm(refined(shown, shown.frame(), start, prior)) < 10.0
