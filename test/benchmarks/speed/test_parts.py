"""The reference computes the same fitness; all figures of speed are there. No time is tested."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.benchmarks.machine import machine, processor, usable_cores
from markerless_tracker.benchmarks.speed.parts import measure, poses_around
from markerless_tracker.benchmarks.speed.reference import ReferenceFitness
from markerless_tracker.benchmarks.speed.scene import SpeedScene, made_up_scene, recorded_scene
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.errors import DatasetError
from markerless_tracker.fitness import Fitness
from markerless_tracker.imaging import Segmenter, learn_background
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene

SIZE_PX = (322, 244)


@pytest.fixture(scope="module")
def scene() -> SpeedScene:
    return made_up_scene(frames=2, size_px=SIZE_PX)


def evidence(scene: SpeedScene) -> dict[str, Observation]:
    images = scene.frames[0].images
    return {
        name: Segmenter(name, learn_background(empty)).observe(images[name], 0)
        for name, empty in scene.empty.items()
    }


@pytest.mark.parametrize("name", ["balan31", "person31"])
def test_the_reference_computes_the_same_fitness(scene, name) -> None:
    body = scene.body(name)
    pose = scene.pose(body)
    observations = evidence(scene)
    fitness = Fitness(body, scene.rig.cameras, edge_rule="sides")
    views = fitness.lay_out(observations)
    reference = ReferenceFitness(body, scene.rig.cameras, observations, pose)
    # Its outlines are polygons of 16 points, its samples as many as at the first pose.
    for one in poses_around(body, pose, 5):
        terms = fitness.terms(views, one).values()
        f = np.mean([t.silhouette + t.edges for t in terms])
        assert 2.0 - reference(one[None])[0] == pytest.approx(f, abs=0.03)


def test_the_reference_gives_the_same_costs_one_by_one(scene) -> None:
    body = scene.body("balan31")
    poses = poses_around(body, scene.pose(body), 4)
    reference = ReferenceFitness(body, scene.rig.cameras, evidence(scene), poses[0])
    assert reference(poses) == pytest.approx([reference(one[None])[0] for one in poses], abs=1e-9)
    assert 20 <= reference.edge_samples <= 400


def test_the_reference_outside_the_view(scene) -> None:
    body = scene.body("balan31")
    pose = scene.pose(body)
    reference = ReferenceFitness(body, scene.rig.cameras, evidence(scene), pose)
    away = np.tile(pose, (2, 1))
    away[:, body.index("pelvis_tx")] += [3.0, 500.0]
    costs = reference(away)
    assert np.isfinite(costs).all() and (costs > reference(pose[None])).all()


def numbers(figures: Mapping[str, object]) -> list[float]:
    found: list[float] = []
    for value in figures.values():
        found.extend(numbers(value) if isinstance(value, Mapping) else [value])
    return found


def test_every_figure_is_there(scene) -> None:
    reports = []
    figures = measure(
        scene, threads=2, repeats=1, progress=lambda part, done, total: reports.append(part)
    )
    parts = {"full", "limb", "limb_soft", "person31", "reference"}
    assert set(figures["view_evaluation_us"]) == parts
    assert list(figures["swarm_ms"]) == ["sppso_1000", "hmcpso_3600", "hmcpso_3600_hard"]
    assert all(ratio > 0.0 for ratio in figures["swarm_ratio"].values())
    assert set(figures["frame_ms"]) == {"background", "edges", "imaging", "fitness", "total"}
    for spread in (*figures["swarm_ms"].values(), *figures["frame_ms"].values()):
        assert spread["p95"] >= spread["median"] > 0.0
    assert figures["image_size"] == list(SIZE_PX)
    assert (figures["cameras"], figures["threads"]) == (4, 2)
    assert {"cpu", "cores"} <= set(figures["machine"]) and "numpy" in figures["versions"]
    view = figures["view_evaluation_us"]
    assert figures["reference_ratio"] == view["reference"] / view["full"]
    assert figures["limb_ratio"] == view["limb"] / view["full"]
    assert figures["limb_soft_ratio"] == view["limb_soft"] / view["full"]
    timed = ("view_evaluation_us", "swarm_ms", "frame_ms", "thousand_evaluations_ms")
    assert all(np.isfinite(numbers({key: figures[key] for key in timed})))
    assert figures["fit_vs_1000_evaluations"] > 0.0 and np.isfinite(figures["refine_ms"])
    swarms = {f"swarm {name}" for name in figures["swarm_ms"]}
    assert set(reports) == {"view-evaluations", *swarms, "refinement", "frames"}


def test_a_recording_as_the_scene(tmp_path: Path, make_recording) -> None:
    made = SyntheticScene(body="person31", cameras=2, size_px=(200, 152), samples=1)
    synthesize(tmp_path / "walk", made, frames=3, lossless=True)
    scene = recorded_scene(tmp_path / "walk", frames=2)
    assert (
        scene.name == "walk" and len(scene.frames) == 2 and set(scene.empty) == {"cam01", "cam02"}
    )
    assert np.abs(scene.markers_m["Head"] - made.markers(0)[2]).max() < 1e-5
    with pytest.raises(DatasetError, match=r"small: no ground_truth\.trc"):
        recorded_scene(make_recording(), frames=2)
    with pytest.raises(DatasetError, match="1 frame from the start on"):
        recorded_scene(tmp_path / "walk", frames=1)


def test_the_name_of_the_processor(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor\t: 0\nmodel name\t: Some CPU @ 2.45GHz\nflags: a b\n")
    assert processor(cpuinfo) == "Some CPU @ 2.45GHz"
    assert processor(tmp_path / "none") != ""
    assert machine()["cores"] == usable_cores() >= 1
