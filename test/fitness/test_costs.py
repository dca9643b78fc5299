"""The terms of a view and the costs made of them: weights, rules, values in odd cases."""

import numpy as np
import pytest

from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness import COSTS, EDGE_RULES, EDGE_TERMS, Fitness
from markerless_tracker.fitness.raster import kernels
from markerless_tracker.records import Observation

FAR_M = 1000.0


def black(rig: CameraRig, make_observation) -> dict[str, Observation]:
    return {c.name: make_observation(c, np.zeros(c.size_px[::-1], dtype=bool)) for c in rig}


def test_the_cost_is_the_weights_sum_minus_the_mean_of_the_terms(
    body, rig, pose, observations, make_comparison
):
    fitness = Fitness(body, rig.cameras)
    views = fitness.lay_out(observations)
    terms = fitness.terms(views, pose)
    f_s = np.mean([t.silhouette for t in terms.values()])
    f_e = np.mean([t.edges for t in terms.values()])
    assert 0.3 < f_s < 0.99
    assert 0.1 < f_e < 0.99
    for silhouette, edges in ((1.0, 1.0), (1.0, 0.5), (0.0, 1.0), (2.0, 0.0)):
        evaluate = fitness.prepare(
            views, make_comparison(body, pose, silhouette_weight=silhouette, edge_weight=edges)
        )
        expected = silhouette + edges - silhouette * f_s - edges * f_e
        assert evaluate(pose[None])[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("term", EDGE_TERMS)
@pytest.mark.parametrize("rule", EDGE_RULES)
def test_without_edge_samples_f_e_is_zero(
    body, rig, pose, observations, rule, term, make_comparison
):
    fitness = Fitness(body, rig.cameras, edge_rule=rule, edge_term=term)
    views = fitness.lay_out(observations)
    none = np.zeros(len(body.cone_names), dtype=bool)
    f_s = np.mean([t.silhouette for t in fitness.terms(views, pose).values()])
    cost = fitness.prepare(views, make_comparison(body, pose, edge_cones=none))(pose[None])[0]
    assert cost == pytest.approx(2.0 - f_s, abs=1e-12)


def test_full_edges_everywhere_are_perfect_for_both_terms(make_observation, body, rig, pose):
    bright = {
        c.name: make_observation(
            c, np.zeros(c.size_px[::-1], bool), np.full(c.size_px[::-1], 255, np.uint8)
        )
        for c in rig
    }
    for term in EDGE_TERMS:
        fitness = Fitness(body, rig.cameras, edge_term=term)
        for terms in fitness.terms(fitness.lay_out(bright), pose).values():
            assert terms.edges == pytest.approx(1.0, abs=1e-12)


def test_the_two_edge_terms_on_a_uniform_map(make_observation, body, rig, pose):
    grey = {
        c.name: make_observation(
            c, np.zeros(c.size_px[::-1], bool), np.full(c.size_px[::-1], 51, np.uint8)
        )
        for c in rig
    }
    for term, expected in (("mean", 0.2), ("ssd", 1.0 - 0.8**2)):
        fitness = Fitness(body, rig.cameras, edge_term=term)
        for terms in fitness.terms(fitness.lay_out(grey), pose).values():
            assert terms.edges == pytest.approx(expected, abs=1e-12)


def test_unknown_rules_and_terms_are_refused(body, rig):
    with pytest.raises(ConfigError, match="edge_rule is 'all', expected one of sides, visible"):
        Fitness(body, rig.cameras, edge_rule="all")
    with pytest.raises(ConfigError, match="edge_term is 'median', expected one of ssd, mean"):
        Fitness(body, rig.cameras, edge_term="median")


def test_h_mcpsos_costs_by_counted_pixels(body, rig, pose, observations, make_comparison):
    """B/(B+Y) one-sided, ½ B/(B+Y) + ½ R/(R+Y) both ways, beside mean (1 - M)²; view by view."""
    every = np.ones(len(body.cone_names), dtype=bool)
    costs = {}
    for cost in COSTS:
        fitness = Fitness(body, rig.cameras, cost=cost, edge_term="mean")
        views = fitness.lay_out(observations)
        costs[cost] = fitness.prepare(views, make_comparison(body, pose, edge_weight=0.5))(
            pose[None]
        )[0]
    plain = Fitness(body, rig.cameras)
    counts = plain.count(views, pose[None], every, every)[0]
    projected, overlap = counts[:, kernels.PROJECTED], counts[:, kernels.OVERLAP]
    seen = np.array(views.arrays.observed, dtype=float)
    edges = counts[:, kernels.EDGE_SUM] / counts[:, kernels.EDGE_COUNT] / 255.0**2
    one_sided = np.mean(1 - overlap / projected + 0.5 * edges)
    both = np.mean(1 - 0.5 * overlap / projected - 0.5 * overlap / seen + 0.5 * edges)
    assert costs["one_sided"] == pytest.approx(one_sided, abs=1e-12)
    assert costs["bidirectional"] == pytest.approx(both, abs=1e-12)
    # SPPSO's cost with the squared edge term is the bidirectional one; with another it is not.
    squared = plain.prepare(views, make_comparison(body, pose, edge_weight=0.5))(pose[None])[0]
    assert squared == pytest.approx(both, abs=1e-12)
    assert abs(costs["overlap"] - both) > 1e-3


def test_one_sided_a_body_within_the_observed_costs_nothing_outside_everything(
    twin, make_observation, body, rig, pose, make_comparison
):
    fitness = Fitness(body, rig.cameras, cost="one_sided")
    full = {c.name: make_observation(c, np.ones(c.size_px[::-1], dtype=bool)) for c in rig}
    away = pose.copy()
    away[body.index("pelvis_tx")] = FAR_M
    silhouettes = make_comparison(body, pose, edge_weight=0.0)
    inside = fitness.prepare(fitness.lay_out(full), silhouettes)
    assert inside(np.stack([pose, away])).tolist() == [0.0, 1.0]
    nothing = fitness.prepare(fitness.lay_out(black(rig, make_observation)), silhouettes)
    assert nothing(np.stack([pose, away])).tolist() == [1.0, 0.0]


def test_an_unknown_cost_is_refused(body, rig):
    with pytest.raises(ConfigError, match="cost is 'none', expected one of overlap, bidirectional"):
        Fitness(body, rig.cameras, cost="none")


def test_a_black_view_is_not_explained_by_a_body_in_it(make_observation, body, rig, pose):
    fitness = Fitness(body, rig.cameras)
    for terms in fitness.terms(fitness.lay_out(black(rig, make_observation)), pose).values():
        assert (terms.silhouette, terms.overlap) == (0.0, 0.0)
        # There are samples of strength 0: 1 - mean (1 - 0)².
        assert terms.edges == 0.0


def test_a_black_view_is_fully_explained_by_a_body_outside_it(make_observation, body, rig, pose):
    fitness = Fitness(body, rig.cameras)
    away = pose.copy()
    away[body.index("pelvis_tx")] = FAR_M
    for terms in fitness.terms(fitness.lay_out(black(rig, make_observation)), away).values():
        assert (terms.silhouette, terms.edges, terms.overlap) == (1.0, 0.0, 1.0)
        assert terms.pixels == 0.0


def test_an_observed_silhouette_is_not_explained_by_a_body_outside(
    body, rig, pose, observations, make_comparison
):
    fitness = Fitness(body, rig.cameras)
    away = pose.copy()
    away[body.index("pelvis_ty")] = -FAR_M
    views = fitness.lay_out(observations)
    for name, terms in fitness.terms(views, away).items():
        assert (terms.silhouette, terms.edges, terms.overlap) == (0.0, 0.0, 0.0)
        assert terms.pixels == observations[name].mask.sum()
    assert fitness.prepare(views, make_comparison(body, away))(away[None])[0] == 2.0
