"""Trials in processes that die on the way: nothing is lost, nothing is done twice."""

import multiprocessing
import os
import shutil
import signal

import pytest

from markerless_tracker.cli import track
from markerless_tracker.cli.batch.cluster import on_cluster
from markerless_tracker.cli.batch.find import find_recordings
from markerless_tracker.cli.batch.plan import plan
from markerless_tracker.cli.batch.processes import ATTEMPTS, on_processes
from markerless_tracker.cli.batch.trial import Trial
from markerless_tracker.cli.batch.verb import add_arguments
from markerless_tracker.cli.main import _Parser

GOOD = ["a/one", "a/two", "b/three"]


@pytest.fixture
def planned(trials, options, tmp_path) -> list[Trial]:
    """Four trials, of which one fails."""
    parser = _Parser()
    add_arguments(parser)
    args = parser.parse_args([str(trials), "-o", str(tmp_path / "out"), *options])
    return plan(args, find_recordings(trials), threads=1)


def records(planned: list[Trial]) -> dict[str, int]:
    """Name -> time at which the record was written."""
    return {t.name: t.record.stat().st_mtime_ns for t in planned if t.record.exists()}


def test_a_process_that_is_killed_costs_no_trial(planned, tmp_path) -> None:
    rows, seen = {}, {}
    for trial, row in on_processes(planned, 1):
        assert trial.name not in rows
        rows[trial.name] = row
        seen |= {name: at for name, at in records(planned).items() if name not in seen}
        if len(rows) == 1:
            # The next trial has begun in it, or begins in it now.
            (worker,) = multiprocessing.active_children()
            os.kill(worker.pid, signal.SIGKILL)
    assert sorted(name for name in rows if rows[name]["status"] == "done") == GOOD
    assert "cam02.mkv" in rows["b/broken"]["error"]
    assert records(planned) == seen
    assert multiprocessing.active_children() == []


def test_a_trial_whose_processes_die_fails_alone(planned) -> None:
    # A call of it with a trial ends the process, since it takes a number.
    rows = dict((trial.name, row) for trial, row in on_processes(planned[:1], 2, do=os._exit))
    assert rows["a/one"]["status"] == "failed"
    assert rows["a/one"]["error"] == (
        f"its process died {ATTEMPTS} times: killed, or out of memory"
    )


def test_a_cluster_does_them_too_and_survives_a_worker(planned) -> None:
    distributed = pytest.importorskip(
        "distributed", reason="distributed is not installed (extra [cluster])"
    )
    shutil.rmtree(planned[1].source)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        rows, seen = {}, {}
        for trial, row in on_cluster(planned, cluster.scheduler_address):
            rows[trial.name] = row
            seen |= {name: at for name, at in records(planned).items() if name not in seen}
            if len(seen) == 1 and len(rows) < 3:
                with distributed.Client(cluster, set_as_default=False) as client:
                    (pid,) = client.run(os.getpid).values()
                os.kill(pid, signal.SIGKILL)
    assert sorted(name for name in rows if rows[name]["status"] == "done") == ["a/one", "b/three"]
    assert "two: no such file" in rows["a/two"]["error"]
    assert records(planned) == seen


def test_batch_has_every_option_of_track() -> None:
    def options(declare) -> dict[str, tuple]:
        parser = _Parser()
        declare(parser)
        return {
            word: (action.dest, action.type, action.choices, action.default, action.nargs)
            for action in parser._actions
            for word in action.option_strings
        }

    of_track, of_batch = options(track.add_arguments), options(add_arguments)
    # The results' place has another meaning.
    assert of_track.pop("-o")[0] == "name" and of_batch.pop("-o")[0] == "out"
    assert {word: of_batch.get(word) for word in of_track} == of_track
    assert set(of_batch) - set(of_track) == {"--jobs", "--scheduler"}


def test_every_option_reaches_the_trials(tmp_path) -> None:
    parser = _Parser()
    track.add_arguments(parser)
    dests = {action.dest for action in parser._actions} - {
        "help",
        "json",
        "force",
        "source",
        "name",
    }
    parser = _Parser()
    add_arguments(parser)
    args = parser.parse_args(
        [str(tmp_path), "-o", str(tmp_path / "out"), "--up=-y", "--scale", "1"]
    )
    (trial,) = plan(args, {"one": tmp_path / "one"}, threads=1)
    assert set(trial.arguments) == dests and trial.arguments["up"] == "-y"
