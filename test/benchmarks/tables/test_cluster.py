"""The same table from the workers of a cluster; errors on a worker name the worker."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from markerless_tracker.benchmarks import cluster as calls
from markerless_tracker.benchmarks.tables import cluster
from markerless_tracker.benchmarks.tables.accuracy import Plan, make_table
from markerless_tracker.benchmarks.tables.evidence import EvidenceOrder
from markerless_tracker.benchmarks.tables.runs import Run
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.errors import ConfigError, DatasetError, TrackerError
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

SWARM = TrackerConfig.from_mapping({"refinement": "none", "evaluations": 200, "threads": 1})


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up walk of a few small frames."""
    scene = SyntheticScene(body="person31", cameras=3, size_px=(200, 152), samples=1)
    folder = tmp_path_factory.mktemp("made") / "walk"
    synthesize(folder, scene, frames=3, lossless=True)
    return folder


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster of two workers on this machine."""
    distributed = pytest.importorskip(
        "distributed", reason="distributed is not installed (extra [cluster])"
    )
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as found:
        yield found.scheduler_address


def without_times(rows):
    return [
        {
            key: value
            for key, value in row.items()
            if key not in ("frames_per_s", "ms_per_evaluation")
        }
        for row in rows
    ]


def test_a_cluster_makes_the_same_table(walk, scheduler, tmp_path, monkeypatch) -> None:
    plan = Plan(
        configs=(SWARM, replace(SWARM, optimizer="apf", evaluations=300)),
        rates=(60.0, 20.0),
        seeds=2,
    )
    here = make_table([walk], plan)
    # A path relative to this process.
    monkeypatch.chdir(walk.parent)
    there = make_table([Path("walk")], replace(plan, scheduler=scheduler), store=tmp_path)
    assert [row.pop("source") for row in there] == ["walk"] * 4
    for row in here:
        row.pop("source")
    assert without_times(here) == without_times(there)
    assert len(list((tmp_path / "runs").iterdir())) == 8


def test_an_error_on_a_worker_is_raised_here(walk, scheduler) -> None:
    plan = Plan(configs=(replace(SWARM, evaluations=7),), rates=(60.0,), seeds=2)
    with pytest.raises(TrackerError, match="evaluations is 7"):
        make_table([walk], replace(plan, scheduler=scheduler))


def test_a_scheduler_that_does_not_answer(walk, monkeypatch) -> None:
    pytest.importorskip("distributed", reason="distributed is not installed (extra [cluster])")
    monkeypatch.setattr(calls, "ANSWER_S", 0.5)
    plan = Plan(configs=(SWARM,), seeds=1)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with pytest.raises(ConfigError, match=f"scheduler {address}: no answer"):
            make_table([walk], replace(plan, scheduler=address))


def test_without_dask_the_message_names_the_extra(walk, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match=r"distributed is not installed.*\[cluster\]"):
        make_table([walk], Plan(configs=(SWARM,), seeds=1, scheduler="tcp://x:1"))


class TestAWorker:
    @pytest.fixture
    def order(self, walk) -> EvidenceOrder:
        return EvidenceOrder(walk, 1.0, SWARM, 0, 1, None, "key")

    @pytest.fixture
    def run(self, walk) -> Run:
        return Run(SWARM, 1, walk / "ground_truth.trc")

    def test_makes_evidence_once(self, order, run, monkeypatch) -> None:
        monkeypatch.setattr(cluster, "_made", {})
        same = calls.code_and_versions()
        first = cluster.execute_there(run, order, same)
        monkeypatch.setattr(EvidenceOrder, "make", None)
        again = cluster.execute_there(run, order, same)
        assert first["frame_mm"] == again["frame_mm"]

    def test_keeps_the_latest_evidence_only(self, order, monkeypatch) -> None:
        monkeypatch.setattr(cluster, "_made", {})
        folders = []
        for count in (1, 2, 3):
            with cluster._evidence(replace(order, frames=count)) as evidence:
                folders.append(evidence.folder)
        assert [folder.exists() for folder in folders] == [False, True, True]

    def test_keeps_the_evidence_of_a_run_that_has_not_opened_it_yet(
        self, order, monkeypatch
    ) -> None:
        monkeypatch.setattr(cluster, "_made", {})
        with cluster._evidence(order) as evidence:
            for count in (1, 2, 3):
                with cluster._evidence(replace(order, frames=count)):
                    pass
            assert len(list(evidence.frames(every=1))) == 3
        assert len(cluster._made) == 2

    def test_makes_evidence_again_for_a_recording_that_has_changed(
        self, order, monkeypatch
    ) -> None:
        monkeypatch.setattr(cluster, "_made", {})
        with cluster._evidence(order) as first, cluster._evidence(replace(order, key="b")) as other:
            assert first.folder != other.folder

    @pytest.mark.parametrize("name", ["code", "numpy"])
    def test_of_another_version_is_refused(self, order, run, name) -> None:
        same = {**calls.code_and_versions(), name: "another"}
        with pytest.raises(
            ConfigError, match=f"worker .*: {name} differ from those of the machine"
        ):
            cluster.execute_there(run, order, same)

    def test_without_the_recording_names_worker_and_recording(self, order, run, tmp_path) -> None:
        lost = replace(order, source=tmp_path / "lost")
        with pytest.raises(DatasetError, match="worker .*lost: no such file or folder"):
            cluster.execute_there(run, lost, calls.code_and_versions())
