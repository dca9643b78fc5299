"""Disturbed frames, and the frame from which a track has recovered."""

from dataclasses import replace

import numpy as np
import pytest

from markerless_tracker.benchmarks.recovery import Disturbance, disturbed, frames_until
from markerless_tracker.records import Observation


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


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ([10.0] * 6, 1),
        ([90.0, 10.0, 10.0, 10.0, 10.0, 10.0], 2),
        ([10.0, 10.0, 90.0, 10.0, 10.0, 10.0, 10.0, 10.0], 4),
        ([np.nan, 10.0, 10.0, 10.0, 10.0, 10.0], 2),
        ([90.0] * 10, None),
        ([10.0] * 4, None),
    ],
)
def test_recovered_means_that_the_error_stays_low(errors, expected) -> None:
    assert frames_until(np.array(errors), 50.0) == expected
