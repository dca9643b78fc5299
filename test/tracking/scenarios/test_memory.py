"""Particle filters go on from the last frame's particles, until the tracker is reset."""

import numpy as np
import pytest


@pytest.mark.parametrize("optimizer", ["apf", "pf"])
def test_particles_outlive_a_frame_and_reset_forgets_them(
    make_tracker, frames, swarm_settings, optimizer
):
    tracker = make_tracker(swarm_settings, optimizer=optimizer, evaluations=300)
    searcher = tracker._searcher
    assert not searcher.particle_sets
    first = tracker.step(frames[0].observations, frames[0].stamp_ns)
    particle_set = searcher.particle_sets["body"]
    assert particle_set.weights.sum() == pytest.approx(1.0)
    second = tracker.step(frames[1].observations, frames[1].stamp_ns)
    assert searcher.particle_sets["body"] is not particle_set
    tracker.reset()
    assert not tracker._searcher.particle_sets
    again = [tracker.step(f.observations, f.stamp_ns) for f in frames[:2]]
    for before, after in zip((first, second), again, strict=True):
        assert before.pose.tobytes() == after.pose.tobytes()


@pytest.mark.parametrize(
    "optimizer", ["sppso", "hmcpso", "hpso", "mcpso", "pso", "glpso", "apf", "pf"]
)
@pytest.mark.parametrize("refined", [False, True])
def test_every_optimizer_follows_a_made_up_person(
    make_tracker, frames, swarm_settings, refined_settings, optimizer, refined
):
    settings = dict(refined_settings if refined else swarm_settings)
    tracker = make_tracker(
        settings, optimizer=optimizer, evaluations=1000 if optimizer == "sppso" else 3600
    )
    for frame in frames[:3]:
        result = tracker.step(frame.observations, frame.stamp_ns)
        gap = 1e3 * np.linalg.norm(result.markers_m - frame.markers_m, axis=1)
        assert gap.mean() < 25.0
    if not refined:
        assert result.evaluations == (1000 if optimizer == "sppso" else 3600)
