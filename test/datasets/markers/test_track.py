"""Marker tracks: what they refuse, selections, the pelvis."""

import numpy as np
import pytest

from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.errors import DatasetError


def track(names=("LHip", "RHip"), stamps=(0, 10)) -> MarkerTrack:
    positions = np.arange(len(stamps) * len(names) * 3, dtype=float)
    return MarkerTrack(names, np.array(stamps), positions.reshape(len(stamps), len(names), 3))


@pytest.mark.parametrize(
    ("names", "stamps", "shape", "reported"),
    [
        (("A",), [0, 1], (1, 1, 3), "shape"),
        (("A", "B"), [0], (1, 1, 3), "shape"),
        (("A", "A"), [0], (1, 2, 3), "distinct"),
        (("A",), [1, 1], (2, 1, 3), "increase"),
    ],
)
def test_contradictions_are_refused(names, stamps, shape, reported) -> None:
    with pytest.raises(DatasetError, match=reported):
        MarkerTrack(names, np.array(stamps), np.zeros(shape))


def test_a_marker_is_missing_as_a_whole() -> None:
    positions = np.array([[[1.0, np.inf, 2.0], [1.0, 2.0, 3.0]]])
    made = MarkerTrack(("A", "B"), np.array([0]), positions)
    assert np.isnan(made.positions_m[0, 0]).all() and np.isfinite(made.positions_m[0, 1]).all()
    assert not made.positions_m.flags.writeable and positions[0, 0, 0] == 1.0


def test_a_missing_pelvis_is_the_middle_of_the_hips() -> None:
    made = track().with_pelvis()
    assert made.names == ("LHip", "RHip", "Pelvis")
    np.testing.assert_allclose(made.positions_m[:, 2], track().positions_m.mean(axis=1))
    own = track(("Pelvis", "LHip", "RHip"))
    assert own.with_pelvis() is own
    bare = track(("LHip", "Head"))
    assert bare.with_pelvis() is bare


def test_selecting() -> None:
    assert track().selected(["RHip"]).positions_m[1, 0].tolist() == [9.0, 10.0, 11.0]
    assert track().rows(slice(1, None)).stamps_ns.tolist() == [10]
    with pytest.raises(DatasetError, match="Nose.*LHip"):
        track().selected(["Nose"])
