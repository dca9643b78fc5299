"""Records that cross rooms: packed masks, observations, stages, results."""

import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from markerless_tracker.errors import ImageError, SearchError
from markerless_tracker.observation import cut_mask, no_edges
from markerless_tracker.records import (
    Comparison,
    Observation,
    SearchPlan,
    Stage,
    TrackResult,
    TrackState,
    locked,
    pack_mask,
    unpack_mask,
)

masks = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=150))


@given(masks)
def test_masks_come_back(mask: np.ndarray) -> None:
    words = pack_mask(mask)
    assert words.dtype == np.uint64 and words.shape == (len(mask), -(-mask.shape[1] // 64))
    np.testing.assert_array_equal(unpack_mask(words, mask.shape[1]), mask)


@given(masks, st.data())
def test_a_part_of_a_packed_mask_is_that_part_packed(mask: np.ndarray, data: st.DataObject) -> None:
    (top, bottom), (left, right) = (
        sorted(data.draw(st.lists(st.integers(0, n), min_size=2, max_size=2, unique=True)))
        for n in mask.shape
    )
    part = cut_mask(pack_mask(mask), left, top, right - left, bottom - top)
    np.testing.assert_array_equal(part, pack_mask(mask[top:bottom, left:right]))


@given(masks)
def test_bits_count_the_pixels_and_padding_is_zero(mask: np.ndarray) -> None:
    assert sum(int(word).bit_count() for word in pack_mask(mask).ravel()) == mask.sum()


@pytest.mark.parametrize("column", [0, 1, 7, 8, 63, 64, 65, 129])
def test_a_column_is_its_bit(column: int) -> None:
    mask = np.zeros((2, 130))
    mask[1, column] = 255
    words = pack_mask(mask)
    expected = np.zeros((2, 3), dtype=np.uint64)
    expected[1, column // 64] = np.uint64(1 << column % 64)
    np.testing.assert_array_equal(words, expected)


def test_any_non_zero_value_is_body() -> None:
    mask = np.array([[0, 1, 255, -3]], dtype=np.int16)
    assert unpack_mask(pack_mask(mask), 4).tolist() == [[False, True, True, True]]


# --- locked ----------------------------------------------------------------------------------


def test_locked_arrays_cannot_be_written() -> None:
    array = np.arange(6.0)
    fixed = locked(array, float)
    with pytest.raises(ValueError, match="read-only"):
        fixed[0] = 1.0
    array[1] = 7.0  # its owner still may


def test_locked_copies_only_what_it_must() -> None:
    array = np.arange(6.0)
    assert np.shares_memory(locked(array, float), array)
    assert locked(array, np.float32).dtype == np.float32
    transposed = np.arange(6.0).reshape(2, 3).T
    assert locked(transposed, float).flags.c_contiguous and transposed.flags.writeable


# --- observations ----------------------------------------------------------------------------


@given(masks, st.integers(0, 9), st.integers(0, 9), st.integers(0, 9), st.integers(0, 9))
def test_observations_give_back_what_they_hold(
    mask: np.ndarray, u: int, v: int, right: int, below: int
) -> None:
    height, width = mask.shape
    edges = np.arange(height * width, dtype=np.uint8).reshape(height, width)
    size = (u + width + right, v + height + below)
    seen = Observation.from_mask("cam01", 5, mask, edges, size_px=size, offset_px=(u, v))
    np.testing.assert_array_equal(seen.mask, mask)
    np.testing.assert_array_equal(seen.edges, edges)
    assert (seen.width, seen.height, seen.size_px, seen.offset_px) == (width, height, size, (u, v))
    assert seen.stamp_ns == 5 and not seen.edges.flags.writeable


@given(masks, st.integers(0, 70), st.integers(0, 9), st.integers(0, 70), st.integers(0, 9))
def test_a_region_in_the_full_frame(
    mask: np.ndarray, u: int, v: int, right: int, below: int
) -> None:
    height, width = mask.shape
    edges = np.full(mask.shape, 7, np.uint8)
    size = (u + width + right, v + height + below)
    seen = Observation.from_mask("cam01", 5, mask, edges, size_px=size, offset_px=(u, v))
    frame = seen.in_full_frame(seen.mask)
    np.testing.assert_array_equal(frame, np.pad(mask, ((v, below), (u, right))))
    assert seen.in_full_frame(edges).sum() == 7 * mask.size
    if size == (width, height):
        assert seen.in_full_frame(edges) is edges


def test_the_region_is_the_frame_unless_given() -> None:
    seen = Observation.from_mask("cam01", 0, np.ones((4, 7)), np.zeros((4, 7), np.uint8))
    assert seen.size_px == (7, 4) and seen.offset_px == (0, 0)


@pytest.mark.parametrize(
    ("size", "offset", "words", "message"),
    [
        ((9, 4), (3, 0), 1, r"cam01: region 7x4 at \(3, 0\) does not lie inside .* 9x4"),
        ((9, 9), (-1, 0), 1, r"cam01: region 7x4 at \(-1, 0\)"),
        ((9, 5), (0, 2), 1, r"cam01: region 7x4 at \(0, 2\)"),
        ((9, 9), (0, 0), 2, r"cam01: observation holds edges \(4, 7\) and mask words \(4, 2\)"),
    ],
)
def test_observations_that_contradict_themselves(
    size: tuple[int, int], offset: tuple[int, int], words: int, message: str
) -> None:
    with pytest.raises(ImageError, match=message):
        Observation("cam01", 0, size, offset, np.zeros((4, words), np.uint64), np.zeros((4, 7)))


def observed(mask: np.ndarray, undecided: np.ndarray | None) -> Observation:
    edges = np.zeros(mask.shape, np.uint8)
    return Observation.from_mask("cam01", 5, mask, edges, undecided=undecided)


@given(masks, st.integers(0, 2**32 - 1))
def test_undecided_pixels_come_back(mask: np.ndarray, seed: int) -> None:
    undecided = (np.random.default_rng(seed).random(mask.shape) < 0.4) & ~mask
    seen = observed(mask, undecided)
    np.testing.assert_array_equal(seen.mask, mask)
    if undecided.any():
        np.testing.assert_array_equal(seen.undecided, undecided)
        assert seen.undecided_words is not None and not seen.undecided_words.flags.writeable
    else:
        assert seen.undecided is None and seen.undecided_words is None
    np.testing.assert_array_equal(seen.not_background, mask | undecided)
    decided = seen.with_masks(mask | undecided, None)
    np.testing.assert_array_equal(decided.mask, mask | undecided)
    assert decided.undecided is None
    assert (decided.stamp_ns, decided.edges) == (seen.stamp_ns, seen.edges)


def test_an_observation_comes_back_from_another_process() -> None:
    mask = np.zeros((40, 300), np.uint8)
    mask[10:20, 100:130] = 1
    strong = np.full(mask.shape, 7, np.uint8)
    sizes = []
    for edges in (np.zeros_like(mask), strong):
        one = Observation.from_mask("cam01", 5, mask, edges, undecided=1 - mask)
        stored = pickle.dumps(one, protocol=5)
        sizes.append(len(stored))
        other = pickle.loads(stored)
        for name in ("mask", "undecided", "edges"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
            assert not other.edges.flags.writeable
        assert (other.camera, other.stamp_ns, other.size_px) == ("cam01", 5, (300, 40))
    assert sizes[0] + mask.size <= sizes[1], "an empty edge map was sent"


def test_no_pixel_is_person_and_undecided() -> None:
    mask = np.zeros((4, 70), bool)
    mask[2, 68] = True
    assert observed(mask, ~mask).undecided is not None
    with pytest.raises(ImageError, match="cam01: undecided words .* no pixel in both"):
        observed(mask, mask)


def test_undecided_pixels_of_another_size() -> None:
    with pytest.raises(ImageError, match=r"cam01: undecided words \(4, 2\) beside .* \(4, 1\)"):
        observed(np.zeros((4, 7)), np.ones((4, 70)))


# --- stages and results ----------------------------------------------------------------------

COMPARISON = {
    "active": [0, 2], "centre": np.zeros(3), "silhouette_weight": 1.0, "edge_weight": 0.5,
    "silhouette_cones": [True], "edge_cones": [False],
}  # fmt: skip
PLAN = {"algorithm": "sppso", "sigma": np.ones(3), "particles": 10, "iterations": 20}


def test_a_stage_is_a_comparison_and_a_plan_both_frozen() -> None:
    stage = Stage("one", Comparison(**COMPARISON), SearchPlan(**PLAN))
    assert stage.plan.evaluations == 200 and stage.comparison.active.dtype == np.int64
    for array in (stage.comparison.centre, stage.plan.sigma):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        stage.plan.particles = 1  # type: ignore[misc]


def test_stages_change_in_one_part() -> None:
    stage = Stage("one", Comparison(**COMPARISON), SearchPlan(**PLAN))
    moved, longer = stage.centred(np.ones(3)), stage.planned(iterations=30, min_improvement=0.1)
    assert moved.plan is stage.plan and longer.comparison is stage.comparison
    np.testing.assert_array_equal(moved.comparison.centre, 1.0)
    assert (longer.plan.iterations, longer.plan.min_improvement) == (30, 0.1)
    assert (stage.plan.iterations, longer.plan.particles, longer.name) == (20, 10, "one")


def test_the_whole_body_is_compared_with_every_cone() -> None:
    whole = Comparison.whole(np.zeros(3), 2, edge_weight=0.5)
    assert whole.active.tolist() == [0, 1, 2]
    assert whole.silhouette_cones.tolist() == whole.edge_cones.tolist() == [True, True]
    assert (whole.silhouette_weight, whole.edge_weight) == (1.0, 0.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"centre": np.zeros((1, 3))}, r"comparison: centre is \(1, 3\), expected \(p,\)"),
        ({"active": [0, 3]}, r"active parameters are \[0, 3\], expected some of 0\.\.2"),
        ({"active": [-1]}, r"comparison: active parameters are \[-1\]"),
        ({"active": []}, r"comparison: active parameters are \[\]"),
    ],
)
def test_impossible_comparisons(change: dict[str, object], message: str) -> None:
    with pytest.raises(SearchError, match=message):
        Comparison(**{**COMPARISON, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"particles": 0}, "sppso: 0 particles x 20 iterations, expected at least 1"),
        ({"iterations": 0}, "sppso: 10 particles x 0 iterations"),
    ],
)
def test_impossible_plans(change: dict[str, object], message: str) -> None:
    with pytest.raises(SearchError, match=message):
        SearchPlan(**{**PLAN, **change})


def test_both_parts_of_a_stage_are_of_one_pose() -> None:
    with pytest.raises(SearchError, match=r"stage one: centre \(3,\) and sigma \(4,\)"):
        Stage("one", Comparison(**COMPARISON), SearchPlan(**{**PLAN, "sigma": np.ones(4)}))


def test_results_are_read_only_and_may_be_empty() -> None:
    result = TrackResult(1, TrackState.TRACKING, np.zeros(31), np.zeros((15, 3)), 1.5, {}, 1000)
    for array in (result.pose, result.markers_m):
        assert array is not None and not array.flags.writeable
    nothing = TrackResult(1, TrackState.LOST, None, None, float("nan"), {}, 0)
    assert nothing.pose is None and nothing.markers_m is None and nothing.warnings == ()


def test_a_region_in_its_full_frame() -> None:
    mask = np.array([[1, 0, 1], [0, 1, 1]], np.uint8)
    edges = np.zeros(mask.shape, np.uint8)
    seen = Observation.from_mask("cam01", 0, mask, edges, size_px=(6, 5), offset_px=(2, 3))
    expected = np.zeros((5, 6), np.uint8)
    expected[3:5, 2:5] = mask
    np.testing.assert_array_equal(seen.in_full_frame(mask), expected)
    whole = Observation.from_mask("cam01", 0, mask, edges)
    assert whole.in_full_frame(mask) is mask


def test_a_part_of_an_observation_is_cut() -> None:
    rng = np.random.default_rng(3)
    classes = rng.integers(0, 3, (40, 90))
    edges = rng.integers(0, 255, (40, 90), dtype=np.uint8)
    seen = Observation.from_mask(
        "cam01", 7, classes == 1, edges, undecided=classes == 2, size_px=(200, 100),
        offset_px=(30, 20),
    )  # fmt: skip
    part = seen.cut((41, 25, 110, 60))
    assert (part.camera, part.stamp_ns, part.size_px) == ("cam01", 7, (200, 100))
    assert (part.offset_px, part.width, part.height) == ((41, 25), 69, 35)
    inside = np.s_[5:40, 11:80]
    np.testing.assert_array_equal(part.mask, (classes == 1)[inside])
    np.testing.assert_array_equal(part.undecided, (classes == 2)[inside])
    np.testing.assert_array_equal(part.edges, edges[inside])
    assert seen.cut((30, 20, 120, 60)) is seen
    assert dataclasses.replace(seen, exposure=(0.9,)).cut((41, 25, 110, 60)).exposure == (0.9,)


def test_an_edge_map_without_edges_takes_no_memory() -> None:
    mask = np.ones((400, 600), np.uint8)
    seen = Observation.from_mask("cam01", 0, mask, no_edges(mask.shape))
    part = seen.cut((10, 20, 500, 300))
    back = pickle.loads(pickle.dumps(part))
    for one in (seen, part, back):
        assert not one.has_edges and not one.edges.any() and one.edges.strides == (0, 0)
        assert one.edges.shape == one.mask.shape
    # Other maps of one value, and of another type.
    same = Observation.from_mask("cam01", 0, mask, np.broadcast_to(np.uint8(9), mask.shape))
    assert same.has_edges and (same.cut((0, 5, 600, 400)).edges == 9).all()
    floats = Observation.from_mask("cam01", 0, mask, np.broadcast_to(0.0, mask.shape))
    assert floats.edges.dtype == np.uint8 and not floats.has_edges
    # The part of a map whose edges are all elsewhere.
    edges = np.zeros(mask.shape, np.uint8)
    edges[0] = 9
    assert not Observation.from_mask("cam01", 0, mask, edges).cut((0, 5, 600, 400)).edges.any()
