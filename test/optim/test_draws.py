"""Keyed draws: the same key the same stream, any other key another."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.optim import keyed_generator

KEY = (3, 1_000_000_000, "body")


def test_the_first_draws_of_one_key_never_change():
    """Results are remade from seed and stamps: another stream would be another result."""
    drawn = keyed_generator(*KEY).integers(0, 2**63, 3)
    assert drawn.tolist() == [
        4257921753906945908,
        3515408570544222653,
        6186336781119186624,
    ]


@pytest.mark.parametrize(
    "other",
    [
        (4, KEY[1], "body"),
        (3, KEY[1] + 1, "body"),
        (3, KEY[1], "root"),
        (3, KEY[1] + 2**32, "body"),
    ],
)
def test_seed_stamp_and_stage_each_make_another_stream(other):
    a = keyed_generator(*KEY).random(8)
    assert not np.any(a == keyed_generator(*other).random(8))


def test_the_same_key_gives_the_same_draws_whatever_was_drawn_before():
    first = keyed_generator(*KEY)
    first.random(1000)
    keyed_generator(9, 9, "x").random(10)
    np.testing.assert_array_equal(keyed_generator(*KEY).random(8), keyed_generator(*KEY).random(8))


@given(st.integers(0, 2**63 - 1), st.integers(-(2**63), 2**63 - 1), st.text(max_size=20))
def test_any_key_is_a_key(seed, stamp_ns, stage):
    draws = keyed_generator(seed, stamp_ns, stage).random(4)
    np.testing.assert_array_equal(draws, keyed_generator(seed, stamp_ns, stage).random(4))
