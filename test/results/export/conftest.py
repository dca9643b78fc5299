"""Results of made-up motions, and independent readers of exports."""

import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, Subject, load_body, markers
from markerless_tracker.records import Confidence, TrackResult, TrackState
from markerless_tracker.results.result import ResultWriter
from markerless_tracker.tracking import TrackerConfig

START_NS = 1_500_000_000
PERIOD_NS = 16_666_667


@pytest.fixture(scope="session")
def person() -> BodyModel:
    """A body whose lengths are no one's generic ones."""
    body = load_body("person31", 1.81)
    lengths = {**body.lengths_m, "l_thigh": 0.5, "r_forearm": 0.21}
    cones = dict(zip(body.cone_names, body.cone_shape, strict=True))
    return load_body("person31", Subject("odd", lengths, cones))


@pytest.fixture(scope="session")
def motion(person: BodyModel) -> np.ndarray:
    """(12, p) poses that move every parameter by about half a radian."""
    rng = np.random.default_rng(5)
    poses = person.neutral + rng.normal(0.0, 0.3, (12, person.size))
    poses[:, person.translations] = rng.normal(0.0, 1.0, (12, len(person.translations)))
    return poses


@pytest.fixture
def make_result(person: BodyModel, motion: np.ndarray, tmp_path: Path) -> Callable[..., Path]:
    """`make_result(lost=, left_out=, poses=)`: NAME of a result.

    Frames lost, stamps without a frame, the poses (default: those of `motion`).
    """

    def make(
        lost: Sequence[int] = (),
        left_out: Sequence[int] = (),
        poses: np.ndarray = motion,
        **options: bool,
    ) -> Path:
        name = tmp_path / "made" / "walk"
        config = TrackerConfig.from_mapping({"body": "person31"})
        with ResultWriter(name, person, config, fps=60.0, source="odd", **options) as writer:
            for index, pose in enumerate(poses):
                if index in left_out:
                    continue
                sd = np.full((15, 3), 0.01 * (1 + index))
                found = TrackResult(
                    stamp_ns=START_NS + index * PERIOD_NS,
                    state=TrackState.LOST if index in lost else TrackState.TRACKING,
                    pose=pose,
                    markers_m=markers(person, pose),
                    fitness=1.5,
                    iou={"cam01": 0.8},
                    evaluations=10,
                    confidence=Confidence(np.full(person.size, 0.02), sd, np.eye(6)),
                )
                writer.add(found)
                writer.body = replace(person)
        return name

    return make


@pytest.fixture
def readers(project_root: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """`readers(name)`: a module of `bench/results`."""
    monkeypatch.syspath_prepend(project_root / "bench" / "results")
    return importlib.import_module


@pytest.fixture
def read_bvh(readers: Callable[[str], ModuleType]) -> type:
    """The class `Bvh`."""
    found: type = readers("bvh_file").Bvh
    return found
