"""Bodies of any size, and the prior of segment lengths."""

import numpy as np
import pytest

from markerless_tracker.body import load_body, load_description
from markerless_tracker.body.sizes import (
    GIVEN_STATURE_SD,
    MEAN_STATURE_M,
    PROPORTION_SD,
    STATURE_SD,
    Sizes,
)
from markerless_tracker.errors import BodyModelError

SIZES = Sizes(load_description("person31"))


def test_both_sides_have_the_same_lengths() -> None:
    assert SIZES.names == (
        "torso", "head", "clavicle", "upper_arm", "forearm", "hip_offset", "thigh", "calf",
        "hand", "foot",
    )  # fmt: skip


def test_a_generic_body_is_that_of_its_stature() -> None:
    body, same = SIZES.of_stature(1.83), load_body("person31", 1.83)
    for name in ("node_fixed", "marker_offset", "cone_fixed", "cone_length", "cone_shape"):
        np.testing.assert_allclose(getattr(body, name), getattr(same, name), rtol=0, atol=1e-12)
    assert body.lengths_m == same.lengths_m


def test_lengths_of_a_body_give_the_same_body() -> None:
    lengths = SIZES.of(SIZES.of_stature(1.7)) * np.linspace(0.9, 1.1, len(SIZES.names))
    body = SIZES.body(lengths)
    np.testing.assert_allclose(SIZES.of(body), lengths, rtol=1e-15)
    assert body.lengths_m["l_thigh"] == body.lengths_m["r_thigh"] == lengths[6]


def test_generic_sections_scale_with_length_and_given_ones_do_not() -> None:
    small, tall = SIZES.of_stature(1.5), SIZES.of_stature(1.8)
    np.testing.assert_allclose(tall.cone_shape, small.cone_shape * 1.2, rtol=1e-12)
    kept = SIZES.body(SIZES.of(tall), small)
    np.testing.assert_array_equal(kept.cone_shape, small.cone_shape)
    np.testing.assert_allclose(kept.cone_length, tall.cone_length, rtol=1e-14)


def test_an_impossible_length_is_named() -> None:
    with pytest.raises(BodyModelError, match=r"torso.*expected metres between 0 and 3"):
        SIZES.body(np.full(len(SIZES.names), -1.0))


@pytest.mark.parametrize(("stature", "common"), [(None, STATURE_SD), (1.9, GIVEN_STATURE_SD)])
def test_the_prior_has_the_variance_of_stature_and_proportions(stature, common) -> None:
    """One length alone may be off by both; the ratio of two only by their own parts."""
    prior = SIZES.prior(stature)
    covariance = np.linalg.inv(prior.precision)
    generic = SIZES.of(SIZES.of_stature(stature or MEAN_STATURE_M))
    np.testing.assert_allclose(np.exp(prior.mean), generic)
    assert covariance[0, 0] == pytest.approx(PROPORTION_SD**2 + common**2)
    ratio = covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1]
    assert ratio == pytest.approx(2.0 * PROPORTION_SD**2)


@pytest.mark.parametrize("name", ["person31", "person32", "balan31", "humaneva34"])
def test_bodies_with_given_sections_are_those_that_are_built(name) -> None:
    sizes = Sizes(load_description(name))
    generic = sizes.of_stature(1.62)
    lengths = sizes.of(generic) * np.linspace(1.15, 0.85, len(sizes.names))
    built, found = sizes.body(lengths), sizes.body(lengths, generic)
    assert found.lengths_m == built.lengths_m
    for part in ("node_fixed", "marker_offset", "cone_fixed", "cone_length"):
        np.testing.assert_allclose(getattr(found, part), getattr(built, part), rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found.cone_shape, generic.cone_shape)
    assert found.measured == generic.measured
