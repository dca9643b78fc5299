"""When several threads are used; the result does not depend on it."""

import subprocess
import sys
import threading

import numpy as np
import pytest

from markerless_tracker.fitness import Fitness, threads
from markerless_tracker.fitness.threads import (
    launch_cost_s,
    mapper,
    side_by_side,
    usable_threads,
    worth_waking,
)


def test_threads_are_woken_if_they_save_time(monkeypatch):
    monkeypatch.setattr(threads, "launch_cost_s", lambda count: 1e-4)
    assert not worth_waking(10.0, 1)
    # Two threads save half of the work: 0.5 ms against three times 0.1 ms.
    assert worth_waking(1e-3, 2)
    assert not worth_waking(5e-4, 2)


def test_work_is_done_once_by_each_thread():
    done = []
    side_by_side(lambda thread: done.append((thread, threading.get_ident())), 3)
    assert sorted(thread for thread, _ in done) == [0, 1, 2]
    assert dict(done)[0] == threading.get_ident() and len({where for _, where in done}) > 1


def test_what_a_thread_raises_is_raised():
    def work(thread):
        if thread == 1:
            raise ValueError("from the other thread")

    with pytest.raises(ValueError, match="from the other thread"):
        side_by_side(work, 2)


def test_items_are_shared_with_the_calling_thread():
    both_at_work = threading.Barrier(2, timeout=300)

    def work(item):
        both_at_work.wait()
        return item * item, threading.get_ident()

    done = mapper(2)(work, range(4))
    assert [value for value, _ in done] == [0, 1, 4, 9]
    where = {thread for _, thread in done}
    assert len(where) == 2 and threading.get_ident() in where


def test_one_thread_needs_no_pool():
    assert mapper(1) is map and mapper(0) is map


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_the_error_of_the_first_item_is_raised(threads):
    done = []

    def work(item):
        if item in (1, 3):
            raise ValueError(f"item {item}")
        done.append(item)

    with pytest.raises(ValueError, match="item 1"):
        mapper(threads)(work, range(5))
    assert sorted(done) == [0, 2, 4]


def test_a_map_within_a_map_of_the_same_threads_ends():
    shared_map = mapper(2)
    done = shared_map(lambda row: sum(shared_map(lambda item: row * item, range(3))), range(4))
    assert list(done) == [0, 3, 6, 9]


def test_nothing_to_map():
    assert list(mapper(2)(abs, [])) == []


def test_a_forked_process_has_threads_of_its_own():
    """Those of its parent do not exist in it."""
    program = (
        "import os; from markerless_tracker.fitness.threads import side_by_side\n"
        "def note(thread): os.write(1, b'%d ' % thread)\n"
        "side_by_side(note, 2)\n"
        "child = os.fork()\n"
        "side_by_side(note, 2)\n"
        "if child: os.waitpid(child, 0)\n"
        "else: os._exit(0)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120
    )
    assert sorted(result.stdout.split()) == ["0"] * 3 + ["1"] * 3


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
