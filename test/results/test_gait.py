"""Gait of made-up walkers whose steps are known."""

import numpy as np
import pytest

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.results.gait import gait
from markerless_tracker.results.stored_result import StoredResult

STRIDE_M, STRIDE_S, STANCE = 1.30, 1.10, 0.62


def walker(
    fps: float = 60.0, seconds: float = 8.0, *, heading: float = 0.4, speed: float = 1.0
) -> StoredResult:
    """A person who walks straight on; each foot stays, then swings to its next place."""
    count = round(seconds * fps)
    times = np.arange(count) / fps
    period = STRIDE_S / speed
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    positions = np.zeros((count, 15, 3))
    pelvis = times[:, None] * (STRIDE_M / period) * ahead + (0.0, 0.0, 0.9)
    positions[:] = pelvis[:, None]
    for name, shift, side in (("LAnkle", 0.0, 0.1), ("RAnkle", 0.5, -0.1)):
        phase = times / period + shift
        swing = np.clip((phase % 1.0 - STANCE) / (1.0 - STANCE), 0.0, 1.0)
        # A strike falls on whole phases, half a step's length ahead of the pelvis.
        way = np.floor(phase) + 0.5 * (1.0 - np.cos(np.pi * swing)) - shift + 0.5 * STANCE
        across = side * np.array([-ahead[1], ahead[0], 0.0])
        positions[:, MARKER_NAMES.index(name)] = STRIDE_M * way[:, None] * ahead + across
    empty = np.full((count, 0), np.nan)
    return StoredResult(
        source="",
        fps=fps,
        summary={},
        marker_names=MARKER_NAMES,
        parameter_names=(),
        angle_names=(),
        camera_names=(),
        stamps_ns=np.rint(times * 1e9).astype(np.int64),
        states=np.full(count, "TRACKING"),
        filled=np.zeros(count, dtype=np.bool_),
        fitness=np.ones(count),
        positions_m=positions,
        positions_sd_m=np.full(positions.shape, 0.01),
        parameters=empty,
        parameters_sd=empty,
        angles_deg=empty,
        angles_sd_deg=empty,
        overlap=empty,
    )


def parameters(result: StoredResult) -> dict[str, float]:
    found = gait(result)
    assert found is not None
    return {entry.name: entry.mean for entry in found.parameters()}


@pytest.mark.parametrize("fps", [20.0, 60.0, 120.0])
def test_parameters_of_a_straight_walk(fps: float) -> None:
    found = parameters(walker(fps))
    assert found["stride length"] == pytest.approx(STRIDE_M, abs=0.03)
    assert found["stride time"] == pytest.approx(STRIDE_S, abs=0.01)
    assert found["cadence"] == pytest.approx(120.0 / STRIDE_S, rel=0.01)
    assert found["speed"] == pytest.approx(STRIDE_M / STRIDE_S, abs=0.02)
    # The foot falls behind the pelvis until it is faster than the pelvis.
    assert found["stance"] == pytest.approx(100.0 * STANCE, abs=8.0)


def test_events_of_both_feet_by_turns() -> None:
    found = gait(walker())
    assert found is not None
    strikes = [event for event in found.events if event.strike]
    assert [event.side for event in strikes[:4]] in (
        ["left", "right"] * 2, ["right", "left"] * 2,
    )  # fmt: skip
    left = np.array([event.time_s for event in strikes if event.side == "left"])
    # Strikes are at whole strides.
    np.testing.assert_allclose(left / STRIDE_S, np.rint(left / STRIDE_S), atol=0.06)
    assert all(stride.side in ("left", "right") for stride in found.strides)


def test_who_stands_or_stays_in_place_does_not_walk() -> None:
    walking = walker()
    ankles = [MARKER_NAMES.index(name) for name in ("LAnkle", "RAnkle")]
    still = np.array(walking.positions_m)
    still -= still[:, :1] - still[:1, :1]
    assert gait(walking.with_arrays(positions_m=still)) is None, "a treadmill"
    still[:, ankles] = still[:1, ankles]
    assert gait(walking.with_arrays(positions_m=still)) is None
    assert gait(walker(10.0)) is None, "too few frames for events"
    assert gait(walking.rows(slice(0, 0))) is None


def test_gaps_divide_the_walk_and_add_no_stride() -> None:
    whole = walker()
    positions = np.array(whole.positions_m)
    positions[230:290] = np.nan
    found = gait(whole.with_arrays(positions_m=positions))
    all_found = gait(whole)
    assert found is not None and all_found is not None
    assert 0 < len(found.strides) < len(all_found.strides)
    lengths = [stride.length_m for stride in found.strides]
    np.testing.assert_allclose(lengths, STRIDE_M, atol=0.06)
    positions = np.array(whole.positions_m)
    positions[230:233] = np.nan
    short = gait(whole.with_arrays(positions_m=positions))
    assert short is not None and len(short.strides) == len(all_found.strides)
