"""Disturbed frames, and the frame from which a track has recovered."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from markerless_tracker.benchmarks.recovery import (
    Disturbance,
    disturbed,
    frames_until,
    measure_recovery,
)
from markerless_tracker.cli.benchmark.recovery import _show
from markerless_tracker.cli.main import main
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.datasets import read_trc, write_trc
from markerless_tracker.errors import DatasetError
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig


def frames(count: int):
    mask = np.zeros((8, 70), np.uint8)
    mask[2, 3] = 1
    undecided = np.zeros((8, 70), np.uint8)
    undecided[5] = 1
    views = {
        name: Observation.from_mask(name, 0, mask, mask, undecided=undecided) for name in "abc"
    }
    return [
        (i, {name: replace(view, stamp_ns=i) for name, view in views.items()}) for i in range(count)
    ]


@pytest.mark.parametrize(("blind", "names"), [(None, "abc"), (2, "ab"), (0, "")])
def test_black_views_have_a_silhouette_of_all_pixels(blind, names) -> None:
    out = disturbed(frames(10), 3, 6, Disturbance("x", 0.1, blind), 30.0)
    for index, frame in enumerate(out):
        assert frame is not None
        for name, view in frame[1].items():
            black = 3 <= index < 6 and name in names
            assert view.mask.sum() == (8 * 70 if black else 1)
            assert view.has_edges == (not black)


@pytest.mark.parametrize(("first", "left"), [(0, "bc"), (2, "ab"), (4, "ac")])
def test_a_stopped_camera_has_no_view(first, left) -> None:
    out = disturbed(frames(6), 2, 4, Disturbance("x", 0.1, stopped=1), 30.0, first=first)
    for index, frame in enumerate(out):
        assert frame is not None
        assert "".join(frame[1]) == (left if 2 <= index < 4 else "abc")
        assert all(view.mask.sum() == 1 for view in frame[1].values())


def test_black_cameras_are_counted_from_the_first_one() -> None:
    out = disturbed(frames(2), 0, 2, Disturbance("x", 0.1, 2), 30.0, first=2)
    black = [name for name, view in out[0][1].items() if view.mask.sum() > 1]
    assert black == ["a", "c"]


def test_a_lower_rate_leaves_out_frames() -> None:
    out = disturbed(frames(40), 10, 34, Disturbance("x", 0.4, 0, 10.0), 60.0)
    assert [i for i, frame in enumerate(out) if frame is None] == [
        i for i in range(10, 34) if (i - 9) % 6
    ]


@pytest.mark.parametrize(("fps", "kept"), [(60.0, 10), (25.0, 10), (30000 / 1001, 10), (12.5, 10)])
def test_a_lower_rate_is_kept_on_average(fps: float, kept: int) -> None:
    count = round(fps)
    out = disturbed(frames(2 * count), 0, 2 * count, Disturbance("x", 2.0, 0, 10.0), fps)
    assert sum(frame is not None for frame in out[:count]) in (kept - 1, kept)
    assert sum(frame is not None for frame in out) in (2 * kept - 1, 2 * kept)


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ([10.0] * 6, 1),
        ([90.0, 10.0, 10.0, 10.0, 10.0, 10.0], 2),
        ([10.0, 10.0, 90.0, 10.0, 10.0, 10.0, 10.0, 10.0], 4),
        ([np.inf, 10.0, 10.0, 10.0, 10.0, 10.0], 2),
        ([np.nan, 10.0, 10.0, 10.0, 10.0, 10.0], 2),
        ([10.0, np.nan] * 4 + [10.0], 1),
        ([90.0, np.nan, 10.0, np.nan, 10.0, 10.0, np.nan, 10.0, 10.0], 3),
        ([10.0, np.nan, 10.0, np.inf, 10.0, 10.0, 10.0], None),
        ([90.0] * 10, None),
        ([10.0] * 4, None),
    ],
)
def test_recovered_means_that_the_error_stays_low(errors, expected) -> None:
    assert frames_until(np.array(errors), 50.0) == expected


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made-up standing person at 10 frames/s, long enough for the shortest disturbance only."""
    scene = SyntheticScene(
        body="person31", motion="stand", cameras=3, size_px=(200, 152), fps=10.0, samples=1
    )
    folder = tmp_path_factory.mktemp("made") / "stand"
    synthesize(folder, scene, frames=33, lossless=True)
    return folder


def test_a_person_is_found_again_after_black_views(stand: Path, capsys) -> None:
    words = ["recovery", str(stand), "--stature", "1.72", "--seeds", "1", "--threads", "1"]
    assert main(["benchmark", *words, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    (run,) = row["runs"]
    assert run["disturbance"] == "all views black, 0.5 s" and run["begins"] == 6
    assert run["back"] and run["worst_mm"] < 150.0 and row["undisturbed_mm"][0] < 60.0
    _show(Console(width=120), [row])
    out = " ".join(capsys.readouterr().out.split())
    assert "stand: too short, or its rate too low, for: all views black, 2 s;" in out


def test_a_recording_too_short_for_every_disturbance_is_refused(stand: Path, tmp_path) -> None:
    for file in stand.iterdir():
        if file.name != "ground_truth.trc":
            (tmp_path / file.name).symlink_to(file)
    truth = read_trc(stand / "ground_truth.trc")
    write_trc(tmp_path / "ground_truth.trc", truth.rows(slice(0, 30)), 10.0)
    config = TrackerConfig.from_mapping({"threads": 1})
    with pytest.raises(
        DatasetError, match="33 frames, expected 5 or more with a truth after the first 26, for"
    ):
        measure_recovery(tmp_path, config, stature_m=1.72, seeds=1)
