"""Every optimiser's stages: published evaluations, hierarchies, who joins softly, refinement."""

import numpy as np
import pytest

from markerless_tracker.body import load_body
from markerless_tracker.errors import BodyModelError, ConfigError
from markerless_tracker.optim import ALGORITHMS
from markerless_tracker.records import CONTOUR
from markerless_tracker.tracking import OPTIMIZERS, TrackerConfig
from markerless_tracker.tracking.config import PAPERS
from markerless_tracker.tracking.stages import STAGES
from markerless_tracker.tracking.stages.budget import SWARM_SHARE
from markerless_tracker.tracking.stages.frame import LIMB_SWARM, frame_stages

BODIES = {
    name: load_body(name, 1.75)
    for name in ("balan31", "person31", "person32", "person35", "humaneva34", "person34")
}
SIX = ["root", "torso_head", "l_arm", "r_arm", "l_leg", "r_leg"]


def stages(**settings):
    config = TrackerConfig.from_mapping({"preset": "paper", **settings})
    body = BODIES[config.body]
    return frame_stages(body, config, body.neutral, body.sigma)


def spent(found):
    return sum(stage.plan.evaluations for stage in found)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize(
    ("optimizer", "evaluations"),
    [("sppso", 1000), ("hmcpso", 3600), ("hpso", 3600), ("mcpso", 3600), ("pso", 3600),
     ("apf", 3600), ("pf", 3600), ("glpso", 3600)],
)  # fmt: skip
def test_the_published_evaluations_are_the_default(optimizer, evaluations, body):
    found = stages(optimizer=optimizer, body=body)
    assert spent(found) == evaluations
    assert {stage.plan.algorithm for stage in found} <= set(ALGORITHMS)
    assert len({stage.name for stage in found}) == len(found)


@pytest.mark.parametrize("evaluations", [3600, 7200, 10800])
@pytest.mark.parametrize("sub_swarms", [2, 3, 4, 5])
def test_tables_3_and_4_scale_the_particles_of_h_mcpso(evaluations, sub_swarms):
    found = stages(optimizer="hmcpso", evaluations=evaluations, **{"hmcpso.sub_swarms": sub_swarms})
    assert spent(found) == evaluations
    assert [(s.plan.particles, s.plan.iterations) for s in found] == [(evaluations // 180, 30)] * 6
    assert {s.plan.options["sub_swarms"] for s in found} == {sub_swarms}


@pytest.mark.parametrize(
    ("optimizer", "evaluations", "shape"),
    [
        ("apf", 1000, [(200, 5)]), ("apf", 2000, [(400, 5)]), ("apf", 3600, [(600, 6)]),
        ("apf", 7200, [(1200, 6)]), ("pf", 1000, [(1000, 1)]), ("pso", 3600, [(20, 180)]),
        ("mcpso", 7200, [(40, 180)]), ("hpso", 3600, [(10, 60)] * 6),
        ("hpso", 7200, [(20, 60)] * 6), ("glpso", 3600, [(20, 120), (10, 60), (10, 60)]),
        ("sppso", 4000, [(40, 20), (80, 40)]),
    ],
)  # fmt: skip
def test_other_budgets_keep_the_iterations(optimizer, evaluations, shape):
    found = stages(optimizer=optimizer, evaluations=evaluations)
    assert [(s.plan.particles, s.plan.iterations) for s in found] == shape


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"optimizer": "hmcpso", "evaluations": 1000}, "hmcpso cannot .* 900 or 1080"),
        ({"optimizer": "hmcpso", "evaluations": 540}, "3 particles for 3 sub-swarms and a master"),
        ({"optimizer": "mcpso", "evaluations": 360}, "2 particles for 3 sub-swarms"),
        ({"optimizer": "hpso", "evaluations": 1000}, "hpso cannot .* 720 or 1080"),
        ({"optimizer": "apf", "evaluations": 1001}, "apf cannot .* 1000 or 1005"),
        ({"optimizer": "apf", "evaluations": 1000, "apf.layers": 7}, "apf cannot .* 994 or 1001"),
    ],
)
def test_a_budget_that_cannot_be_spent_is_refused(settings, message):
    with pytest.raises(ConfigError, match=message) as caught:
        stages(**settings)
    assert str(caught.value).startswith(f"evaluations is {settings['evaluations']}")


def test_h_mcpsos_six_steps_and_who_joins_softly():
    """Torso and legs: the root; arms: the torso joint; each with a tenth of its spread."""
    body = BODIES["humaneva34"]
    found = stages(optimizer="hmcpso")
    assert [s.name for s in found] == [f"step {name}" for name in SIX]
    assert [s.comparison.active.size for s in found] == [6, 4 + 6, 7 + 3, 7 + 3, 5 + 6, 5 + 6]
    plain = found[0].plan.sigma
    for stage, name in zip(found, SIX, strict=True):
        own = body.subspaces[name]
        np.testing.assert_array_equal(stage.plan.sigma[own], plain[own])
        joined = np.setdiff1d(stage.comparison.active, own)
        np.testing.assert_allclose(stage.plan.sigma[joined], plain[joined] / 10.0)
        expected = {"root": [], "torso_head": "root", "l_arm": "torso", "r_arm": "torso"}.get(
            name, "root"
        )
        np.testing.assert_array_equal(joined, np.sort(body.subspaces[expected]) if expected else [])
        assert stage.comparison.silhouette_cones.all() and stage.comparison.edge_cones.all()


@pytest.mark.parametrize("settings", [{"optimizer": "hpso"}, {"optimizer": "hmcpso"}])
def test_a_hard_partition_varies_a_steps_own_parameters_alone(settings):
    found = stages(**settings, partition="hard")
    assert [s.comparison.active.size for s in found] == [6, 4, 7, 7, 5, 5]
    assert sorted(np.concatenate([s.comparison.active for s in found])) == list(range(34))


def test_sppsos_hard_partition_leaves_the_root():
    _, second = stages(optimizer="sppso", partition="hard")
    np.testing.assert_array_equal(second.comparison.active, BODIES["balan31"].joints)


@pytest.mark.parametrize(
    ("body", "sizes"),
    [
        ("balan31", [3, 3, 2, 3, 4, 4, 2, 2, 2, 2, 2, 2]),
        ("humaneva34", [3, 3, 3, 1, 4, 4, 3, 3, 2, 2, 3, 3]),
    ],
)
def test_hpsos_own_twelve_steps(body, sizes):
    found = stages(optimizer="hpso", **{"hmcpso.hierarchy": "twelve"}, evaluations=7200, body=body)
    assert [s.comparison.active.size for s in found] == sizes
    assert {(s.plan.particles, s.plan.iterations) for s in found} == {(10, 60)}
    assert sorted(np.concatenate([s.comparison.active for s in found])) == list(range(sum(sizes)))


def test_a_body_without_the_hierarchy_is_refused():
    import dataclasses

    body = dataclasses.replace(BODIES["balan31"], hierarchies={})
    config = TrackerConfig.from_mapping({"optimizer": "glpso", "preset": "paper"})
    with pytest.raises(BodyModelError, match="balan31 has no hierarchy 'limbs', expected one of"):
        frame_stages(body, config, body.neutral, body.sigma)


def test_spreads_of_the_preset_paper():
    """A variance of 0.01 rad² for every angle; positions, and all of APF's, the body's own."""
    body = BODIES["humaneva34"]
    at = [body.index(f"pelvis_t{axis}") for axis in "xyz"]
    swarm, apf = stages(optimizer="hmcpso")[0].plan.sigma, stages(optimizer="apf")[0].plan.sigma
    np.testing.assert_allclose(swarm[at], body.sigma[at])
    np.testing.assert_allclose(np.delete(swarm, at), 0.1)
    np.testing.assert_allclose(apf, body.sigma)


def test_spreads_grow_with_the_time_between_frames():
    """An angle's only once its own spread exceeds the one that is printed for all."""
    body = BODIES["humaneva34"]

    def sigmas(**settings):
        config = TrackerConfig.from_mapping({"preset": "paper", "optimizer": "pso", **settings})
        found = [frame_stages(body, config, body.neutral, k * body.sigma)[0] for k in (1, 3)]
        return [stage.plan.sigma for stage in found]

    one, three = sigmas(**{"sigma.angle": 0.0})
    np.testing.assert_allclose(three, 3.0 * one)
    one, three = sigmas()
    at, knee, head = (body.index(name) for name in ("pelvis_tx", "l_knee", "head_x"))
    assert three[at] == pytest.approx(3.0 * one[at])
    assert (one[knee], three[knee]) == pytest.approx((0.1, 3.0 * 0.09281))
    assert one[head] == three[head] == 0.1


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_beside_a_refinement_every_swarm_keeps_its_share_and_must_gain(optimizer):
    found = stages(optimizer=optimizer, preset="tuned")
    budget = 1000 if optimizer == "sppso" else 3600
    assert [found[0].plan.algorithm, found[-1].plan.algorithm] == [CONTOUR, CONTOUR]
    swarms, limbs = found[1:-5], found[-5:-1]
    assert spent(swarms) == budget * SWARM_SHARE
    assert {s.plan.min_improvement for s in swarms + limbs} == {0.001}
    assert [s.plan.particles for s in limbs] == [LIMB_SWARM[0] * budget // 1000] * 4
    assert len({s.name for s in found}) == len(found)


def test_every_algorithm_of_a_stage_takes_the_stages_options():
    from markerless_tracker.optim import Problem, everything_feasible

    for optimizer in STAGES:
        for stage in stages(optimizer=optimizer):
            plan, active = stage.plan, stage.comparison.active
            ALGORITHMS[plan.algorithm](
                Problem(
                    np.tile([[-9.0], [9.0]], (1, active.size)), stage.comparison.centre[active],
                    plan.sigma[active], plan.particles, plan.iterations, everything_feasible,
                    np.random.default_rng(0),
                ),
                **plan.options,
            )  # fmt: skip


def test_every_optimizer_has_its_stages_and_its_paper():
    assert set(STAGES) == set(OPTIMIZERS) == set(PAPERS)
    for optimizer in OPTIMIZERS:
        config = TrackerConfig.from_mapping({"optimizer": optimizer, "preset": "paper"})
        assert config.body == ("balan31" if optimizer == "sppso" else "humaneva34")
        assert (config.cost == "overlap") == (optimizer == "sppso")
        assert TrackerConfig.from_mapping(config.as_mapping()) == config


@pytest.mark.parametrize(
    ("settings", "sizes", "shape"),
    [
        ({}, [6, 31], [(10, 20), (20, 40)]),
        ({"partition": "hard"}, [6, 25], [(10, 20), (20, 40)]),
        ({"sppso.stages": "three"}, [6, 11, 31], [(10, 20), (10, 20), (20, 30)]),
        (
            {"sppso.stages": "three", "partition": "hard"}, [6, 5, 20],
            [(10, 20), (10, 20), (20, 30)],
        ),
        ({"sppso.stages": "global"}, [31], [(20, 50)]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("factor", [1, 4])
def test_sppsos_ablation_spends_the_same_evaluations(settings, sizes, shape, factor):
    found = stages(optimizer="sppso", evaluations=1000 * factor, **settings)
    assert [s.comparison.active.size for s in found] == sizes
    assert [(s.plan.particles, s.plan.iterations) for s in found] == [
        (factor * n, k) for n, k in shape
    ]
    assert spent(found) == 1000 * factor
    if settings.get("partition") == "hard":
        assert sorted(np.concatenate([s.comparison.active for s in found])) == list(range(31))


def test_what_earlier_stages_of_sppso_found_keeps_a_small_spread():
    """Positions of the root, and all of torso and head, a tenth; the root's angles as they are."""
    body = BODIES["balan31"]
    at = [body.index(f"pelvis_t{axis}") for axis in "xyz"]
    root, trunk, whole = stages(optimizer="sppso", **{"sppso.stages": "three"})
    np.testing.assert_array_equal(root.plan.sigma, body.sigma)
    expected = body.sigma.copy()
    expected[at] /= 10.0
    np.testing.assert_allclose(trunk.plan.sigma, expected)
    expected[body.subspaces["torso_head"]] /= 10.0
    np.testing.assert_allclose(whole.plan.sigma, expected)
    (alone,) = stages(optimizer="sppso", **{"sppso.stages": "global"})
    np.testing.assert_array_equal(alone.plan.sigma, body.sigma)
    every = [stage.comparison.edge_cones.all() for stage in (root, trunk, alone)]
    assert every == [False, True, True]


@pytest.mark.parametrize("kind", ["two", "three", "global"])
def test_beside_a_refinement_the_ablation_looks_widely_for_its_share(kind):
    found = stages(optimizer="sppso", **{"sppso.stages": kind}, preset="tuned")
    swarms = found[1:-5]
    assert spent(swarms) == 1000 * SWARM_SHARE
    assert max(s.plan.iterations for s in swarms) == 10


def test_three_stages_need_a_subspace_for_the_second():
    import dataclasses

    whole = BODIES["balan31"]
    bare = {name: part for name, part in whole.subspaces.items() if name != "torso_head"}
    body = dataclasses.replace(whole, subspaces=bare)
    config = TrackerConfig.from_mapping({"preset": "paper", "sppso.stages": "three"})
    with pytest.raises(BodyModelError, match="'three': body balan31 has no subspace 'torso_head'"):
        frame_stages(body, config, body.neutral, body.sigma)
