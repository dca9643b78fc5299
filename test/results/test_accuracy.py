"""Whole recordings through the tracker: the errors are the figures that README publishes."""

import re
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker import (
    MARKER_NAMES,
    MarkerTrack,
    TrackerConfig,
    build_tracker,
    open_recording,
    read_trc,
    recording_backgrounds,
    score,
    track_recording,
)

TOLERANCE = 0.15
"""Relative difference between an error and its published figure."""
SCALES = {"render_walk": 1.0, "balance_real": 0.5}
STARTED_FRAMES = 30
"""Frames after an automatic start that published errors leave out."""


def published_mm(readme: str, name: str, fps: int) -> float:
    """The figure of README's table of accuracy."""
    row = re.search(rf"^\| `{name}`.*?\| ([\d.]+) mm \| ([\d.]+) mm \|", readme, re.MULTILINE)
    assert row is not None, f"README has no figures of {name}"
    return float(row[{60: 1, 20: 2}[fps]])


def published_automatic_mm(readme: str, name: str) -> float:
    """README's figure of a recording without a start."""
    row = re.search(rf"^\| `{name}`(?:[^|]*\|){{3}} ([\d.]+) mm ", readme, re.MULTILINE)
    assert row is not None, f"README has no figure of {name} without a start"
    return float(row[1])


def errors_mm(
    folder: Path,
    *,
    scale: float,
    fps: float,
    start: bool = True,
    **changes,
) -> tuple[float, float]:
    """Mean error, mm, of a tracked recording, and that of its first result held all the time."""
    recording = open_recording(folder, scale=scale)
    config = TrackerConfig.from_mapping({"seed": 0, "threads": 0, **changes})
    reference = read_trc(folder / "ground_truth.trc")
    setup = build_tracker(
        recording.rig,
        config,
        backgrounds=recording_backgrounds(recording, config),
        start_file=folder / "ground_truth.trc" if start else None,
    )
    nothing = np.full((len(MARKER_NAMES), 3), np.nan)
    stamps, rows = [], []
    for tracked in track_recording(recording, setup, fps=fps):
        stamps.append(tracked.result.stamp_ns)
        markers_m = tracked.result.markers_m
        rows.append(nothing if markers_m is None else markers_m)
    first = 0 if start else STARTED_FRAMES
    times, found = np.array(stamps)[first:], np.array(rows)[first:]
    held = np.repeat(found[:1], len(found), axis=0)
    return tuple(  # type: ignore[return-value]
        score(MarkerTrack(MARKER_NAMES, times, points), reference).mean_mm
        for points in (found, held)
    )


@pytest.fixture(scope="module")
def readme(project_root: Path) -> str:
    return (project_root / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("fps", [60, 20])
@pytest.mark.parametrize("name", list(SCALES))
def test_the_error_is_the_published_one(name, fps, readme, request) -> None:
    folder = request.getfixturevalue(name)
    mean_mm, held_mm = errors_mm(folder, scale=SCALES[name], fps=fps)
    expected = published_mm(readme, name, fps)
    assert mean_mm == pytest.approx(expected, rel=TOLERANCE)
    assert held_mm > 5.0 * expected, "the start pose itself would pass"


def test_the_published_preset_follows_the_person(render_walk) -> None:
    """Its error differs by tens of mm between seeds."""
    mean_mm, held_mm = errors_mm(render_walk, scale=1.0, fps=60, preset="paper")
    assert mean_mm < 0.15 * held_mm


@pytest.mark.long
@pytest.mark.parametrize("name", list(SCALES))
def test_the_error_without_a_start_is_the_published_one(name, readme, request) -> None:
    folder = request.getfixturevalue(name)
    mean_mm, held_mm = errors_mm(folder, scale=SCALES[name], fps=60, start=False)
    expected = published_automatic_mm(readme, name)
    assert mean_mm == pytest.approx(expected, rel=TOLERANCE)
    assert held_mm > 5.0 * expected, "the first pose itself would pass"
