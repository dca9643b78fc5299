"""Samples of the edge map along one side, by hand."""

import numpy as np

from markerless_tracker.fitness import EDGE_RULES
from markerless_tracker.fitness.raster.edge_samples import EdgeRule, sample_side
from markerless_tracker.fitness.terms import EDGE_TOP
from markerless_tracker.records import Observation


def sample(p, q, edges, rule: str, *, bits=None, outward=1.0, spacing=5.0, squared=False):
    height, width = edges.shape
    rows = np.zeros((height, (width + 63) // 64), dtype=np.uint64) if bits is None else bits
    total, number, _ = sample_side(
        float(p[0]), float(p[1]), float(q[0]), float(q[1]), outward, rows.T.ravel(),
        np.empty(0, dtype=np.uint64), 0, edges.ravel(), 0, width, height,
        EdgeRule(EDGE_RULES[rule], spacing, 2.0, squared), np.empty((0, 2), dtype=np.int64), 0,
    )  # fmt: skip
    return number, total / EDGE_TOP ** (2 if squared else 1)


def test_samples_of_one_side_by_hand():
    edges = np.zeros((40, 60), dtype=np.uint8)
    edges[10, 20:30] = 255
    # Nine samples at 12.5, 17.5 .. 52.5 px; two of them, at 22.5 and 27.5, meet the edge.
    assert sample([10, 10], [55, 10], edges, "sides") == (9, 2.0)
    assert sample([10, 10], [55, 10], edges, "sides", squared=True) == (9, 7.0)
    # Never fewer than four: 10.375, 11.125, 11.875, 12.625.
    assert sample([10, 20], [13, 20], edges, "sides")[0] == 4
    # Those outside the frame do not count: 52.5, 57.5 of 50 .. 80 remain.
    assert sample([50, 10], [80, 10], edges, "sides")[0] == 2
    assert sample([-50, 10], [-5, 10], edges, "sides")[0] == 0
    assert sample([5, 5], [5, 5], edges, "sides") == (0, 0.0)
    assert sample([np.nan, 5], [5, 5], edges, "sides") == (0, 0.0)


def test_body_pixels_hide_a_sample():
    edges = np.zeros((40, 64), dtype=np.uint8)
    body = Observation.from_mask("c", 0, np.zeros((40, 64), bool), edges).mask_words.copy()
    body[20:, :] = np.uint64(2**64 - 1)
    p, q = [10, 19], [30, 19]
    # Row 19 is free, rows 20 and on are body.
    assert sample(p, q, edges, "visible", bits=body)[0] == 4
    assert sample([10, 20], [30, 20], edges, "visible", bits=body)[0] == 0
    # Outline: from row 19, two px outwards lies row 21 or row 17.
    assert sample(p, q, edges, "outline", bits=body, outward=1.0)[0] == 0
    assert sample(p, q, edges, "outline", bits=body, outward=-1.0)[0] == 4
    # Beyond the frame's border nothing hides.
    assert sample([10, 39], [30, 39], edges, "outline", bits=body, outward=1.0)[0] == 4


def test_samples_near_the_frames_border_are_those_of_a_larger_frame() -> None:
    """Away from the border a loop without branches runs; both must find the same."""
    rng = np.random.default_rng(0)
    inner = rng.integers(0, 256, (30, 40), dtype=np.uint8)
    edges = np.zeros((60, 80), dtype=np.uint8)
    edges[15:45, 20:60] = inner
    body = np.zeros((60, 80), dtype=bool)
    body[30:, 20:60] = rng.random((30, 40)) < 0.5
    for rule in EDGE_RULES:
        for squared in (False, True):
            # From side to side of the small frame, hence within its border and not the large one's.
            small = Observation.from_mask("c", 0, body[15:45, 20:60], inner).mask_words
            large = Observation.from_mask("c", 0, body, edges).mask_words
            found = [
                sample([0.4, v], [39.2, v + 3.3], inner, rule, bits=small, squared=squared)
                for v in (8.0, 13.2)
            ]
            expected = [
                sample([20.4, v + 15], [59.2, v + 18.3], edges, rule, bits=large, squared=squared)
                for v in (8.0, 13.2)
            ]
            np.testing.assert_allclose(found, expected)
