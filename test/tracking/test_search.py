"""Searching one frame by its stages: who wins, and what was spent."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_body, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.camera import CameraRig
from markerless_tracker.drawing import silhouette
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import CONTOUR, Observation
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking import TrackerConfig, search
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.stages.frame import contour_stage, frame_stages
from markerless_tracker.tracking.stages.sppso import sppso_stages
from markerless_tracker.tracking.stages.stage import swarm_stage
from markerless_tracker.tracking.swarms import SWARMS

BODY = load_body("person31", 1.75)
RIG = ring_rig(4, (320, 240))
STAMP_NS = 1_000_000_000


def settings(**changes) -> TrackerConfig:
    return TrackerConfig.from_mapping(
        {"body": "person31", "evaluations": 500, "refinement": "contour", "refine.iterations": 3,
         "sigma.scale": 0.5, "edge_weight": 0.5, "seed": 3, "threads": 1, **changes}
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Person:
    """What the rig sees of a body, the true pose, and a prediction that is some cm off."""

    body: BodyModel
    rig: CameraRig
    pose: FloatArray
    predicted: FloatArray
    observations: dict[str, Observation]

    def searcher(self, config, *, threads=1) -> Searcher:
        return Searcher(self.rig, self.body, config, limits=self.body.limits, threads=threads)

    def f(self, pose, config) -> float:
        """f_s + edge weight f_e over the views, by a fitness of its own."""
        fitness = Fitness(
            self.body, self.rig.cameras, edge_rule=config.edges.rule, edge_term=config.edges.term,
            edge_spacing_px=config.edges.spacing_px, edge_step_px=config.edges.step_px,
        )  # fmt: skip
        terms = fitness.terms(fitness.lay_out(self.observations), pose).values()
        return float(np.mean([t.silhouette + config.edge_weight * t.edges for t in terms]))

    def error_mm(self, pose) -> float:
        gap = markers(self.body, pose) - markers(self.body, self.pose)
        return float(np.linalg.norm(gap, axis=1).mean() * 1000.0)


@pytest.fixture(scope="module")
def person() -> Person:
    rng = np.random.default_rng(12)
    pose = posture(BODY, {"l_shoulder_x": 0.6, "r_shoulder_x": 0.6})
    pose[BODY.joints] += rng.uniform(-0.15, 0.15, BODY.joints.size)
    pose[[BODY.index("pelvis_rz"), BODY.index("pelvis_tz")]] = 0.7, 0.95
    for side in "lr":
        pose[BODY.index(f"{side}_knee")] = pose[BODY.index(f"{side}_elbow")] = -0.6
    predicted = np.clip(pose + 2.0 * BODY.sigma * rng.standard_normal(BODY.size), *BODY.limits)
    observations = {}
    for camera in RIG:
        mask = silhouette(BODY, pose, camera)
        edges = rng.integers(0, 256, mask.shape, dtype=np.uint8)
        observations[camera.name] = Observation.from_mask(camera.name, STAMP_NS, mask, edges)
    return Person(BODY, RIG, pose, predicted, observations)


@pytest.fixture
def found(monkeypatch) -> list[tuple[str, FloatArray]]:
    """Every stage's own result, in order: poses of refinements, points of swarms."""
    results: list[tuple[str, FloatArray]] = []
    plain_refine, plain_run = ContourFrame.refined, SWARMS["sppso"]

    def refine(*args, **kwargs):
        results.append((CONTOUR, plain_refine(*args, **kwargs)))
        return results[-1][1]

    def run(search, **kwargs):
        particles = plain_run(search, **kwargs)
        pose = search.objective.centre.copy()
        pose[search.objective.active] = particles.found
        results.append(("sppso", pose))
        return particles

    monkeypatch.setattr(ContourFrame, "refined", refine)
    monkeypatch.setattr(search, "SWARMS", {"sppso": run})
    return results


def stages(person, config):
    return frame_stages(person.body, config, person.predicted, person.body.sigma)


def searched(person, config, chosen=None, *, threads=1):
    frame = person.searcher(config, threads=threads).frame(
        person.observations, STAMP_NS, person.predicted
    )
    returned = frame.run(stages(person, config) if chosen is None else chosen)
    np.testing.assert_array_equal(returned, frame.pose)
    return frame


# --- with contour stages ----------------------------------------------------------------------


@pytest.mark.parametrize("edge_weight", [0.0, 0.5])
def test_the_best_of_prediction_and_stages_wins(person, found, edge_weight) -> None:
    config = settings(edge_weight=edge_weight, min_improvement=0.0)
    frame = searched(person, config)
    assert [kind for kind, _ in found] == [CONTOUR, *["sppso"] * 6, CONTOUR]
    tried = [person.predicted, *(pose for _, pose in found)]
    f = [person.f(pose, config) for pose in tried]
    assert person.f(frame.pose, config) == pytest.approx(max(f), abs=1e-12)
    np.testing.assert_array_equal(frame.pose, tried[int(np.argmax(f))])
    assert max(f) > f[0]
    assert person.error_mm(frame.pose) < 0.5 * person.error_mm(person.predicted)
    frame.take(person.predicted)
    assert frame.pose is person.predicted and frame.cost == pytest.approx(1 + edge_weight - f[0])


@pytest.mark.parametrize("order", ["swarms first", "swarms last", "root alone first"])
def test_any_order_of_stages_is_compared_by_the_whole_f(person, found, order) -> None:
    """Also where the first stage varies a few parameters or looks at a few cones."""
    config = settings()
    swarms = sppso_stages(person.body, config, person.predicted, 0.5 * person.body.sigma)
    contour = contour_stage("align", person.body, config, person.predicted, person.body.sigma)
    chosen = {
        "swarms first": (*swarms, contour),
        "swarms last": (contour, *swarms),
        "root alone first": (swarms[0], contour),
    }[order]
    frame = searched(person, config, chosen)
    tried = [person.predicted, *(pose for _, pose in found)]
    assert len(tried) == len(chosen) + 1
    best = max(person.f(pose, config) for pose in tried)
    assert person.f(frame.pose, config) == pytest.approx(best, abs=1e-12)


def test_parameters_that_the_first_stage_holds_count_in_the_comparison(person, monkeypatch) -> None:
    """The first stage varies the root; refinement then bends the arms as they are."""
    config = settings()
    arms = np.concatenate([person.body.subspaces[k] for k in ("l_arm", "r_arm")])
    predicted = person.pose.copy()
    predicted[arms] = np.clip(predicted[arms] + 0.4, *person.body.limits[:, arms])

    def refine(contours, start, **_):
        pose = start.copy()
        pose[arms] = person.pose[arms]
        return pose

    monkeypatch.setattr(ContourFrame, "refined", refine)
    shown = replace(person, predicted=predicted)
    root, _ = sppso_stages(person.body, config, predicted, 0.1 * person.body.sigma)
    contour = contour_stage("align", person.body, config, predicted, person.body.sigma)
    frame = searched(shown, config, (root, contour))
    np.testing.assert_array_equal(frame.pose[arms], person.pose[arms])
    assert person.f(frame.pose, config) > person.f(predicted, config)


def test_a_refinement_that_goes_astray_is_left_behind(person, monkeypatch) -> None:
    """The swarm goes on from the prediction, and its result stays."""
    config = settings()
    asked = []

    def astray(contours, start, **_):
        asked.append(start.copy())
        return person.body.neutral.copy()

    monkeypatch.setattr(ContourFrame, "refined", astray)
    frame = searched(person, config)
    np.testing.assert_array_equal(asked[0], person.predicted)
    np.testing.assert_array_equal(asked[1], frame.pose)
    assert person.f(frame.pose, config) > person.f(person.predicted, config)
    assert frame.refinements == 6


def test_a_refinement_that_hits_is_not_spoilt_by_the_swarm(person, monkeypatch) -> None:
    config = settings(edge_weight=0.0)
    monkeypatch.setattr(ContourFrame, "refined", lambda *_, **__: person.pose.copy())
    np.testing.assert_array_equal(searched(person, config).pose, person.pose)


@pytest.mark.parametrize("unusual", ["prior_costs", "off_floor"])
@pytest.mark.parametrize("taken", [True, False])
def test_a_swarm_must_gain_more_than_its_pose_is_unusual(
    person, monkeypatch, unusual, taken
) -> None:
    config, body = settings(), person.body
    gain = person.f(person.pose, config) - person.f(person.predicted, config)
    cost = gain - 0.01 if taken else gain + 0.01
    plain_run, everything = SWARMS["sppso"], np.arange(body.size)

    def run(swarm, **options):
        found_cost = np.array([np.nan])
        return plain_run(swarm, **options)._replace(found=person.pose, found_cost=found_cost)

    for name in ("prior_costs", "off_floor"):
        charged = cost if name == unusual else 0.0
        monkeypatch.setattr(
            search, name,
            lambda _, poses, charged=charged: charged * (poses == person.pose).all(axis=1),
        )  # fmt: skip
    monkeypatch.setattr(search, "SWARMS", {"sppso": run})
    monkeypatch.setattr(ContourFrame, "refined", lambda *_, **__: person.predicted.copy())
    contour = contour_stage("align", body, config, person.predicted, body.sigma)
    swarm = swarm_stage(
        body, config, "all", "sppso", everything, person.predicted, body.sigma, (4, 2)
    )
    frame = searched(person, config, (contour, swarm))
    np.testing.assert_array_equal(frame.pose, person.pose if taken else person.predicted)


def test_each_stage_starts_from_the_estimate_so_far(person, monkeypatch) -> None:
    config, centres = settings(), []

    def watched(stage, **kwargs):
        centres.append(stage.centre.copy())
        return SWARMS["sppso"](stage, **kwargs)

    monkeypatch.setattr(search, "SWARMS", {"sppso": watched})
    monkeypatch.setattr(ContourFrame, "refined", lambda *_, **__: person.pose.copy())
    searched(person, config)
    np.testing.assert_array_equal(centres[0], person.pose[person.body.root])


def test_refinement_gets_limits_beliefs_and_distance(person, monkeypatch) -> None:
    config = settings(
        **{"refine.truncation_m": 0.2, "refine.truncation_end_m": 0.05, "refine.prior": 3.0}
    )
    given = []

    def refine(contours, start, **kwargs):
        given.append(kwargs)
        # Wherever the search went since, the belief is about the prediction.
        return person.pose.copy()

    monkeypatch.setattr(ContourFrame, "refined", refine)
    searched(person, config)
    assert len(given) == 2
    for kwargs in given:
        assert kwargs["truncation_m"] == (0.2, 0.05) and kwargs["iterations"] == 3
        np.testing.assert_array_equal(kwargs["bounds"], person.body.limits)
        predicted, posture = kwargs["priors"]
        np.testing.assert_array_equal(predicted.mean, person.predicted)
        np.testing.assert_allclose(predicted.precision, (3.0 * person.body.sigma) ** -2.0)
        np.testing.assert_array_equal(posture.mean, person.body.prior_mean)
        assert not posture.precision[person.body.root].any()
        assert (posture.precision[person.body.joints] > 0).all()


def test_what_was_spent_with_refinement(person) -> None:
    config = settings(evaluations=1000, **{"refine.iterations": 5})
    frame = searched(person, config)
    assert (frame.evaluations, frame.refinements) == (200 + 4 * 24, 10)


@pytest.mark.parametrize("dark", [["cam02"], list(RIG.names)])
def test_black_views_leave_a_finite_pose_within_limits(person, dark) -> None:
    blank = {
        name: Observation.from_mask(name, STAMP_NS, np.zeros_like(o.edges), np.zeros_like(o.edges))
        for name, o in person.observations.items()
        if name in dark
    }
    config = settings()
    pose = searched(replace(person, observations=person.observations | blank), config).pose
    assert np.isfinite(pose).all()
    assert (pose >= person.body.limits[0]).all() and (pose <= person.body.limits[1]).all()


def test_missing_views(person) -> None:
    two = {name: person.observations[name] for name in ("cam01", "cam02")}
    fewer = replace(person, observations=two)
    frame = searched(fewer, settings())
    assert set(frame.terms()) == set(two)
    assert fewer.error_mm(frame.pose) < fewer.error_mm(person.predicted)


def test_contours_are_made_once(person) -> None:
    frame = person.searcher(settings()).frame(person.observations, STAMP_NS, person.predicted)
    assert frame.contours is frame.contours


# --- without ----------------------------------------------------------------------------------


def test_swarms_alone_give_the_last_ones_best_as_published(person, found) -> None:
    """Even where the prediction, here the truth, explains the views better."""
    config = settings(refinement="none", evaluations=100, **{"sigma.scale": 2.0})
    frame = searched(replace(person, predicted=person.pose), config)
    assert [kind for kind, _ in found] == ["sppso", "sppso"]
    np.testing.assert_array_equal(frame.pose, found[-1][1])
    assert person.f(frame.pose, config) < person.f(person.pose, config)


def test_what_was_spent_without_refinement(person) -> None:
    config = settings(refinement="none", evaluations=300)
    frame = searched(person, config)
    assert (frame.evaluations, frame.refinements) == (300, 0)


@pytest.mark.parametrize("refinement", ["contour", "none"])
def test_same_seed_same_bytes_with_any_threads(person, refinement) -> None:
    config = settings(refinement=refinement)
    one, again, two = (searched(person, config, threads=n).pose for n in (1, 1, 2))
    assert one.tobytes() == again.tobytes() == two.tobytes()
    other = searched(person, settings(refinement="none", seed=4)).pose
    assert other.tobytes() != searched(person, settings(refinement="none")).pose.tobytes()


def test_scatter_is_that_of_the_last_swarm_that_varied_a_parameter(person) -> None:
    config = settings()
    root, body = sppso_stages(person.body, config, person.predicted, 0.5 * person.body.sigma)
    limb = next(s for s in stages(person, config) if s.name == "l_arm")
    alone = searched(person, config, (root,)).particle_sd_ratio
    varied = np.zeros(person.body.size, dtype=bool)
    varied[root.comparison.active] = True
    assert np.isnan(alone[~varied]).all() and (alone[varied] > 0.0).all()
    whole = searched(person, config, (root, body)).particle_sd_ratio
    assert np.isfinite(whole).all()
    both = searched(person, config, (root, body, limb)).particle_sd_ratio
    changed = both != whole
    assert (
        changed[limb.comparison.active].all()
        and not np.delete(changed, limb.comparison.active).any()
    )


def test_a_search_keeps_the_limits_of_what_can_be_reached(person) -> None:
    """Swarms and refinements alike, also where the prediction is beyond them."""
    config = settings()
    twist = person.body.index("l_shoulder_z")
    limits = person.body.limits.copy()
    limits[:, twist] = person.predicted[twist] + np.array([0.1, 0.12])
    searcher = person.searcher(config)
    frame = searcher.frame(person.observations, STAMP_NS, person.predicted, limits=limits)
    found = frame.run(frame_stages(person.body, config, frame.pose, person.body.sigma))
    assert limits[0, twist] <= found[twist] <= limits[1, twist]
