"""Stages of a frame: budgets, SPPSO's soft partition, refinement around it."""

from fractions import Fraction

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import ConfigError
from markerless_tracker.records import CONTOUR
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.stages import STAGES
from markerless_tracker.tracking.stages.budget import SWARM_SHARE, scaled_particles
from markerless_tracker.tracking.stages.frame import LIMB_SWARM, frame_stages
from markerless_tracker.tracking.stages.sppso import SPPSO_STAGES, sppso_stages


@pytest.fixture(scope="module")
def body():
    return load_body("balan31", 1.75)


def swarm(settings, **changes) -> TrackerConfig:
    return TrackerConfig.from_mapping({**settings, **changes})


@pytest.mark.parametrize(
    ("evaluations", "particles"),
    [(1000, (10, 20)), (2000, (20, 40)), (4000, (40, 80)), (100, (1, 2)), (1100, (11, 22))],
)
def test_budgets_scale_the_particles_and_keep_the_iterations(evaluations, particles):
    assert scaled_particles(SPPSO_STAGES["two"], evaluations, "sppso") == particles
    spent = sum(p * i for p, (_, i) in zip(particles, SPPSO_STAGES["two"], strict=True))
    assert spent == evaluations


@pytest.mark.parametrize(
    ("evaluations", "near"), [(1050, "1000 or 1100"), (999, "900 or 1000"), (1, "100 or 200")]
)
def test_a_budget_that_cannot_be_met_names_the_nearest_two(evaluations, near):
    with pytest.raises(ConfigError) as caught:
        scaled_particles(SPPSO_STAGES["two"], evaluations, "sppso")
    assert str(caught.value) == (
        f"evaluations is {evaluations}, which sppso cannot spend exactly: nearest are {near}"
    )


def test_a_share_of_a_budget_is_refused_in_terms_of_the_budget():
    share = Fraction(1, 5)
    assert scaled_particles(SPPSO_STAGES["two"], 1000, "sppso", share=share) == (2, 4)
    assert scaled_particles(SPPSO_STAGES["two"], 5000, "sppso", share=share) == (10, 20)
    with pytest.raises(ConfigError, match="evaluations is 1100, .*: nearest are 1000 or 1500"):
        scaled_particles(SPPSO_STAGES["two"], 1100, "sppso", share=share)


def test_published_stages_of_other_algorithms_scale_as_well():
    assert scaled_particles(((20, 180),), 7200, "x") == (40,)
    with pytest.raises(ConfigError, match="evaluations is 3700, which x .* 3600 or 3780"):
        scaled_particles(((20, 180),), 3700, "x")


def test_stage_1_moves_the_root_stage_2_everything(body, swarm_settings):
    sigma = np.linspace(1.0, 2.0, body.size)
    config = swarm(swarm_settings, edge_weight=0.3)
    first, second = sppso_stages(body, config, body.neutral, sigma)
    assert (first.plan.particles, first.plan.iterations) == (10, 20)
    assert (second.plan.particles, second.plan.iterations) == (20, 40)
    assert first.plan.evaluations + second.plan.evaluations == 1000
    assert first.name != second.name
    np.testing.assert_array_equal(np.sort(first.comparison.active), np.arange(6))
    np.testing.assert_array_equal(second.comparison.active, np.arange(31))
    for stage in (first, second):
        assert (stage.comparison.silhouette_weight, stage.comparison.edge_weight) == (1.0, 0.3)
        assert stage.plan.algorithm == "sppso"
        assert stage.comparison.silhouette_cones.all()
        np.testing.assert_array_equal(stage.comparison.centre, body.neutral)
    # Edges of stage 1: the torso alone.
    assert [n for n, e in zip(body.cone_names, first.comparison.edge_cones, strict=True) if e] == [
        "torso"
    ]
    assert second.comparison.edge_cones.all()
    # Spreads of stage 2: the root's position a tenth, its orientation as it was.
    np.testing.assert_array_equal(first.plan.sigma, sigma)
    expected = sigma.copy()
    expected[3:6] /= 10.0
    np.testing.assert_allclose(second.plan.sigma, expected, rtol=1e-15)


def test_edges_of_stage_1_lie_on_every_cone_that_is_rigid_with_the_root(swarm_settings):
    body = load_body("person31", 1.75)
    first, _ = sppso_stages(body, swarm(swarm_settings), body.neutral, body.sigma)
    chosen = {n for n, e in zip(body.cone_names, first.comparison.edge_cones, strict=True) if e}
    pelvis = body.frames[body.root_frame]
    rigid = {n for n, at in zip(body.cone_names, body.cone_node, strict=True) if at == pelvis}
    assert chosen == rigid
    assert chosen


def test_the_swarm_alone_searches_with_scaled_spreads(body, swarm_settings):
    config = swarm(swarm_settings, **{"sigma.scale": 0.25})
    stages = frame_stages(body, config, body.neutral, body.sigma)
    assert [s.plan.algorithm for s in stages] == ["sppso", "sppso"]
    np.testing.assert_allclose(stages[0].plan.sigma, 0.25 * body.sigma, rtol=1e-15)
    assert sum(s.plan.evaluations for s in stages) == 1000


def test_refinement_stands_before_and_after_a_smaller_swarm(body, refined_settings):
    config = swarm(refined_settings, **{"refine.iterations": 7})
    stages = frame_stages(body, config, body.neutral, body.sigma)
    assert [s.plan.algorithm for s in stages] == [CONTOUR, *["sppso"] * 6, CONTOUR]
    assert len({s.name for s in stages}) == 8
    assert sum(s.plan.evaluations for s in stages[1:3]) == 1000 * SWARM_SHARE
    assert stages[0].plan.iterations == stages[-1].plan.iterations == 7


def test_each_limb_has_a_small_wide_swarm_of_its_own(body, refined_settings):
    config = swarm(refined_settings, **{"refine.limb_sigma": 3.0})
    limbs = {s.name: s for s in frame_stages(body, config, body.neutral, body.sigma)[3:7]}
    assert list(limbs) == ["l_arm", "r_arm", "l_leg", "r_leg"]
    for name, stage in limbs.items():
        np.testing.assert_array_equal(stage.comparison.active, body.subspaces[name])
        np.testing.assert_allclose(stage.plan.sigma, 3.0 * body.sigma)
        assert (stage.plan.particles, stage.plan.iterations) == LIMB_SWARM


def test_beside_a_refinement_every_swarm_must_gain(body, refined_settings, swarm_settings):
    stages = frame_stages(
        body, swarm(refined_settings, min_improvement=0.004), body.neutral, body.sigma
    )
    assert [s.plan.min_improvement for s in stages] == [0.0, *[0.004] * 6, 0.0]
    alone = frame_stages(
        body, swarm(swarm_settings, min_improvement=0.004), body.neutral, body.sigma
    )
    assert {s.plan.min_improvement for s in alone} == {0.0}


def test_a_budget_that_cannot_be_spent_is_refused_in_the_users_terms(
    body, swarm_settings, refined_settings
):
    for settings in (swarm_settings, refined_settings):
        config = swarm(settings, evaluations=1234)
        with pytest.raises(ConfigError, match="evaluations is 1234, which sppso cannot spend"):
            frame_stages(body, config, body.neutral, body.sigma)


def test_every_optimizer_that_can_be_named_has_its_stages():
    choices = {s.name: s.choices for s in TrackerConfig.settings()}["optimizer"]
    assert set(choices or ()) == set(STAGES)
