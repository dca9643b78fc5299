"""Offsets taken off, skipped frames and reported deviations in a score."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from markerless_tracker.body import MARKER_NAMES
from markerless_tracker.datasets import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import rotation_from_rodrigues
from markerless_tracker.results.score import score

FRAME_NS = 16_666_667
MARKERS = len(MARKER_NAMES)


def moving(frames: int, seed: int = 0, *, rotations: float = 1.0) -> MarkerTrack:
    """A person (random joints, hips and shoulders level) that walks and rotates on the floor."""
    random = np.random.default_rng(seed)
    local = random.uniform(-0.5, 0.5, (frames, MARKERS, 3))
    for joint, half in (("Hip", 0.1), ("Shoulder", 0.2)):
        for side, sign in (("L", 1.0), ("R", -1.0)):
            local[:, MARKER_NAMES.index(side + joint)] = (0.0, sign * half, 1.0)
    walked = np.cumsum(random.uniform(-0.1, 0.1, (frames, 3)), axis=0)
    positions = np.einsum("nij,nmj->nmi", headings(frames, rotations), local) + walked[:, None]
    return MarkerTrack(MARKER_NAMES, np.arange(frames) * FRAME_NS, positions)


def headings(frames: int, rotations: float) -> np.ndarray:
    """(n, 3, 3) rotations from the person to the world."""
    angles = np.linspace(0.0, 2.0 * math.pi * rotations, frames)
    return np.array([rotation_from_rodrigues((0.0, 0.0, angle)) for angle in angles])


def shifted(track: MarkerTrack, offset_m: np.ndarray) -> MarkerTrack:
    return MarkerTrack(track.names, track.stamps_ns, track.positions_m + offset_m)


@given(
    arrays(np.float64, (MARKERS, 3), elements=st.floats(-0.2, 0.2)),
    st.floats(-2.0, 2.0),
    st.lists(st.tuples(st.integers(0, 19), st.integers(0, MARKERS - 1)), max_size=40),
)
def test_offsets_of_the_joints_are_taken_off_while_the_person_rotates(
    offsets_m, rotations, missing
) -> None:
    reference = moving(20, rotations=rotations)
    turned = np.einsum("nij,mj->nmi", headings(20, rotations), offsets_m)
    positions = reference.positions_m + turned
    for row, column in missing:
        positions[row, column] = np.nan
    figures = score(MarkerTrack(MARKER_NAMES, reference.stamps_ns, positions), reference)
    assert figures.offsets_off_mm == pytest.approx(0.0, abs=1e-6)
    assert figures.offsets_off_limbs_mm == pytest.approx(0.0, abs=1e-6)
    for name, offset in zip(MARKER_NAMES, offsets_m, strict=True):
        assert figures.bias[name] == pytest.approx(offset * 1000.0, abs=1e-6)


def test_what_changes_stays_when_offsets_are_taken_off() -> None:
    reference = moving(4)
    forward = headings(4, 1.0)[:, :, 0]
    signs = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    figures = score(shifted(reference, (0.03 + 0.01 * signs * forward)[:, None]), reference)
    assert figures.offsets_off_mm > 9.0
    still = score(shifted(reference, (0.01 * signs * forward)[:, None]), reference)
    assert still.offsets_off_mm == pytest.approx(10.0)
    assert still.offsets_off_limbs_mm == pytest.approx(10.0)
    assert still.as_dict()["offsets_off_mm"]["all"] == still.offsets_off_mm


@given(st.integers(0, 2**32 - 1), st.floats(0.5, 100.0))
def test_gaussian_errors_of_known_deviation_are_inside_as_expected(seed, scale_mm) -> None:
    random = np.random.default_rng(seed)
    reference = moving(200)
    sd_mm = scale_mm * random.uniform(0.5, 2.0, reference.positions_m.shape)
    result = shifted(reference, random.normal(size=sd_mm.shape) * sd_mm / 1000.0)
    inside = score(result, reference, markers_sd_mm=sd_mm).inside_sd
    # Five standard deviations of a share of 9000 errors.
    for share, expected in zip(inside, (0.6827, 0.9545, 0.9973), strict=True):
        assert abs(share - expected) < 5.0 * math.sqrt(expected * (1.0 - expected) / 9000)


def test_errors_without_a_deviation_do_not_count() -> None:
    reference = moving(3)
    result = shifted(reference, np.array([0.001, 0.002, 0.003]))
    sd_mm = np.full(reference.positions_m.shape, np.nan)
    assert score(result, reference).inside_sd is None
    assert score(result, reference, markers_sd_mm=sd_mm).inside_sd is None
    sd_mm[1, 4] = (1.6, 1.6, 1.6)
    inside = score(result, reference, markers_sd_mm=sd_mm).inside_sd
    assert inside == pytest.approx((1 / 3, 1.0, 1.0))
    # The midpoint of the hips, made for a result without a Pelvis, has none either.
    columns = [i for i, name in enumerate(MARKER_NAMES) if name != "Pelvis"]
    without = result.selected([MARKER_NAMES[i] for i in columns])
    assert score(without, reference, markers_sd_mm=sd_mm[:, columns]).inside_sd == inside
    with pytest.raises(DatasetError, match=r"\(3, 15, 3\), expected \(3, 14, 3\)"):
        score(without, reference, markers_sd_mm=sd_mm)


def test_the_first_frames_are_skipped_blank_ones_included() -> None:
    reference = moving(10)
    offset_m = np.zeros((10, 1, 3))
    offset_m[:4], offset_m[4:] = 1.0, 0.002
    offset_m[[0, 6]] = np.nan
    result = shifted(reference, offset_m)
    sd_mm = np.repeat(np.full((1, MARKERS, 3), 2.0), 10, axis=0)
    sd_mm[4:] = 1.5
    figures = score(result, reference, markers_sd_mm=sd_mm, skip=4)
    assert (figures.frames, figures.reference_frames) == (5, 6)
    assert figures.mean_mm == pytest.approx(2.0 * math.sqrt(3.0))
    assert figures.stamps_ns.tolist() == [FRAME_NS * i for i in (4, 5, 7, 8, 9)]
    assert figures.inside_sd == (0.0, 1.0, 1.0)
    everything = score(result, reference)
    assert (everything.frames, everything.reference_frames) == (8, 10)


@given(st.integers(-3, 8))
def test_skipped_frames_are_those_of_the_result(skip) -> None:
    reference = moving(15)
    result = reference.rows(np.arange(0, 15, 3))
    if not 0 <= skip < 5:
        with pytest.raises(DatasetError, match=rf"skip {skip} .* 0 to 4: the result has 5 frames"):
            score(result, reference, skip=skip)
        return
    figures = score(result, reference, skip=skip)
    assert (figures.frames, figures.reference_frames) == (5 - skip, 15 - 3 * skip)
