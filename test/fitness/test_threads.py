"""When several threads are used; the result does not depend on it."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from markerless_tracker.fitness import Fitness, threads
from markerless_tracker.fitness.threads import launch_cost_s, usable_threads, worth_waking


def test_threads_are_woken_if_they_save_time(monkeypatch):
    monkeypatch.setattr(threads, "launch_cost_s", lambda count: 1e-4)
    assert not worth_waking(10.0, 1)
    # Two threads save half of the work: 0.5 ms against three times 0.1 ms.
    assert worth_waking(1e-3, 2)
    assert not worth_waking(5e-4, 2)


def test_the_threading_layer_is_chosen_at_the_first_launch_not_at_import():
    program = (
        "import numba, markerless_tracker.tracking as _; print(numba.config.THREADING_LAYER);"
        "from markerless_tracker.fitness.threads import launch_cost_s; launch_cost_s(1);"
        "print(numba.threading_layer())"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True,
        env={k: v for k, v in os.environ.items() if k != "NUMBA_THREADING_LAYER"},
    )  # fmt: skip
    assert result.stdout.split() == ["default", "workqueue"]


@pytest.mark.parametrize(
    ("layer", "started", "expected"),
    [("default", False, "workqueue"), ("default", True, "default"), ("omp", False, "omp")],
)
def test_a_layer_that_the_process_chose_or_started_is_kept(monkeypatch, layer, started, expected):
    monkeypatch.setattr(numba.config, "THREADING_LAYER", layer)
    monkeypatch.setattr(threads, "_layer_started", lambda: started)
    monkeypatch.setattr(numba, "set_num_threads", lambda count: None)
    with threads.parallel(2):
        assert expected == numba.config.THREADING_LAYER


def test_waking_threads_costs_something():
    assert 0.0 < launch_cost_s(usable_threads(2)) < 1.0


@pytest.mark.parametrize("cost", [0.0, np.inf], ids=["always", "never"])
def test_the_same_counts_woken_or_not(monkeypatch, make_pose, make_observation, body, rig, cost):
    monkeypatch.setattr(threads, "launch_cost_s", lambda count: cost)
    rng = np.random.default_rng(1)
    poses = np.stack([make_pose(body, rng, spread_m=0.3) for _ in range(7)])
    every = np.ones(len(body.cone_names), dtype=bool)
    full = np.ones(rig.cameras[0].size_px[::-1], dtype=bool)
    counts = []
    for count in (1, 2):
        fitness = Fitness(body, rig.cameras, threads=count)
        views = fitness.lay_out({c.name: make_observation(c, full) for c in rig})
        counts.append(fitness.count(views, poses, every, every))
    np.testing.assert_array_equal(*counts)
