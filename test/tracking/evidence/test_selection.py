"""Which components of a silhouette are the body's."""

import numpy as np
import pytest

from markerless_tracker.drawing import silhouette
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import ring_rig
from markerless_tracker.tracking.evidence.selection import (
    HAND_M,
    body_lines,
    explained_in_region,
    explained_part,
    place_cones,
)


def lines(camera, body, pose):
    return body_lines(camera, place_cones(body, pose))


@pytest.fixture
def person(body, camera, pose):
    mask = np.asarray(silhouette(body, pose, camera)).astype(bool)
    assert 1000 < mask.sum() < 20000
    return mask


def observe(mask, **region) -> Observation:
    edges = np.full(mask.shape, 9, dtype=np.uint8)
    return Observation.from_mask("cam01", 5, mask, edges, **region)


def with_blob(person, u: int, size: int = 12):
    mask = person.copy()
    mask[80 : 80 + size, u : u + size] = True
    return mask


def test_a_silhouette_in_one_piece_is_not_touched(camera, body, pose, person):
    seen = observe(person)
    assert explained_part(seen, lines(camera, body, pose), 0) == (seen, 0)
    nothing = observe(np.zeros_like(person))
    assert explained_part(nothing, lines(camera, body, pose), 0) == (nothing, 0)


def test_a_blob_far_from_the_body_is_left_out(camera, body, pose, person):
    kept, left_out = explained_part(observe(with_blob(person, 5)), lines(camera, body, pose), 0)
    np.testing.assert_array_equal(kept.mask, person)
    assert left_out == 144
    assert (kept.camera, kept.stamp_ns, kept.size_px) == ("cam01", 5, (240, 180))
    np.testing.assert_array_equal(kept.edges, np.full(person.shape, 9))


def test_undecided_pixels_stay_undecided_where_the_silhouette_is_left_out(
    camera, body, pose, person
) -> None:
    blob = with_blob(person, 5) & ~person
    shadow = np.roll(blob, 30, axis=0)
    seen = observe(person | blob, undecided=shadow)
    kept, left_out = explained_part(seen, lines(camera, body, pose), 0)
    np.testing.assert_array_equal(kept.mask, person)
    np.testing.assert_array_equal(kept.undecided, shadow)
    assert left_out == 144


def test_a_blob_within_the_margin_stays(camera, body, pose, person):
    first = int(np.flatnonzero(person[80:92].any(axis=0))[0])
    mask = with_blob(person, first - 20, 12)
    near = explained_part(observe(mask), lines(camera, body, pose), 15)
    far = explained_part(observe(mask), lines(camera, body, pose), 0)
    assert (near[1], far[1]) == (0, 144)


def test_a_body_in_several_pieces_keeps_them_all(camera, body, pose, person):
    mask = with_blob(person, 5)
    cut = int(np.mean(np.flatnonzero(person.any(axis=1))))
    mask[cut : cut + 2] = False
    kept, left_out = explained_part(observe(mask), lines(camera, body, pose), 0)
    expected = person.copy()
    expected[cut : cut + 2] = False
    np.testing.assert_array_equal(kept.mask, expected)
    assert left_out == mask.sum() - expected.sum()


def test_a_prediction_that_meets_nothing_leaves_all(camera, body, pose, person):
    pose[body.index("pelvis_ty")] -= 1.2
    mask = with_blob(person, 5)
    assert not (np.asarray(silhouette(body, pose, camera)).astype(bool) & mask).any()
    seen = observe(mask)
    assert explained_part(seen, lines(camera, body, pose), 0) == (seen, 0)


@pytest.mark.parametrize("away_m", [50.0, -50.0, 1e9])
def test_a_prediction_out_of_sight_leaves_all(camera, body, pose, person, away_m):
    pose[body.index("pelvis_tx")] = away_m
    seen = observe(with_blob(person, 5))
    assert explained_part(seen, lines(camera, body, pose), 0) == (seen, 0)


def test_regions_are_cut_as_full_frames(camera, body, pose, person):
    mask = with_blob(person, 5)
    window = np.s_[20:170, 3:220]
    region = observe(mask[window], size_px=(240, 180), offset_px=(3, 20))
    kept, left_out = explained_part(region, lines(camera, body, pose), 0)
    np.testing.assert_array_equal(kept.mask, person[window])
    assert left_out == 144
    assert kept.offset_px == (3, 20)


@pytest.mark.parametrize(("larger", "goes_on"), [(0.7, False), (1.5, True)])
def test_a_speck_at_a_side_of_the_region_is_no_limb_that_goes_on(
    camera, body, pose, person, larger, goes_on
) -> None:
    placed = lines(camera, body, pose)
    side = round(larger * HAND_M * placed.focal_px / float(np.median(placed.depths_m)))
    columns = np.flatnonzero(person.any(axis=0))
    left = columns[0] - 8 - side
    window = np.s_[:, left : columns[-1] + 20]
    mask = person.copy()
    mask[80 : 80 + side, left : left + side] = True
    # A shadow joins the patch to the body.
    shadow = np.zeros_like(mask)
    shadow[80, left : left + 100] = True
    place = {"size_px": (240, 180), "offset_px": (int(left), 0)}
    seen = observe(mask[window], undecided=(shadow & ~mask)[window], **place)
    found = explained_in_region(seen, placed, 0, 3)
    assert (found is None) == goes_on


def test_more_specks_than_fit_sixteen_bits(body, pose):
    """A remote segmenter's noise must not stop the tracker."""
    camera = ring_rig(1, (640, 480)).cameras[0]
    mask = np.zeros((480, 640), dtype=bool)
    mask[::2, ::2] = True
    mask[:4] = False
    kept, left_out = explained_part(observe(mask), lines(camera, body, pose), 0)
    assert kept.mask.sum() + left_out == mask.sum()
    assert left_out > 65535
