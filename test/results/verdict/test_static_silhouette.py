"""Silhouette that no limb moves."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from markerless_tracker.records import TrackState
from markerless_tracker.results.verdict import static_silhouette
from markerless_tracker.results.verdict.static_silhouette import (
    LATER_EVERY_NS,
    LEAST,
    StaticSilhouette,
)


def furnished(masks: dict[str, Any], side: int) -> dict[str, Any]:
    """Masks with a square beside the person in one view."""
    shown = {name: mask.copy() for name, mask in masks.items()}
    shown["cam02"][150 : 150 + side, 60 : 60 + side] = True
    return shown


def test_a_person_has_none(scene: Any, result: Any) -> None:
    check = StaticSilhouette(scene.rig)
    for index in range(10):
        check.add(result(index), scene.body)
    assert check.found_m2() == {}


def test_a_square_beside_the_person_is_found_with_its_area(
    scene: Any, result: Any, masks: Any
) -> None:
    check = StaticSilhouette(scene.rig)
    for index in range(LEAST):
        assert check.found_m2() == {}
        check.add(result(index, shown=furnished(masks[index], 24)), scene.body)
    found = check.found_m2()
    # 60 px are a metre.
    assert list(found) == ["cam02"] and found["cam02"] == pytest.approx(0.16, rel=0.3)


def test_what_moves_or_is_thin_is_not_reported(scene: Any, result: Any, masks: Any) -> None:
    moving, thin = StaticSilhouette(scene.rig), StaticSilhouette(scene.rig)
    for index in range(10):
        square = furnished(masks[index], 24)["cam02"] & ~masks[index]["cam02"]
        shown = {**masks[index], "cam02": masks[index]["cam02"] | np.roll(square, 8 * index, 1)}
        moving.add(result(index, shown=shown), scene.body)
        thin.add(result(index, shown=furnished(masks[index], 2)), scene.body)
    assert moving.found_m2() == thin.found_m2() == {}


def test_frames_without_a_tracked_person_are_passed_over(
    scene: Any, result: Any, masks: Any
) -> None:
    check = StaticSilhouette(scene.rig)
    for index in range(10):
        lost = result(index, TrackState.LOST, shown=furnished(masks[index], 24))
        check.add(lost, scene.body)
    assert check.found_m2() == {}


def test_silhouettes_of_regions_count_as_those_of_whole_images(
    scene: Any, result: Any, masks: Any
) -> None:
    """The square lies beside the body, at a side of the region."""
    whole, parts = StaticSilhouette(scene.rig), StaticSilhouette(scene.rig)
    for index in range(LEAST):
        seen = result(index, shown=furnished(masks[index], 24))
        whole.add(seen, scene.body)
        cut = {}
        for name, one in seen.observations.items():
            rows, columns = np.nonzero(one.mask)
            box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
            cut[name] = one.cut(tuple(int(side) for side in box))
            assert not cut[name].is_whole
        parts.add(replace(seen, observations=cut), scene.body)
    assert parts.found_m2() == whole.found_m2() != {}


def test_an_overloaded_tracker_compares_seldom(scene: Any, result: Any, masks: Any) -> None:
    check = StaticSilhouette(scene.rig)
    for index in range(LEAST):
        seen = result(index, shown=furnished(masks[index], 24))
        assert bool(check.add(replace(seen, effort=0.5), scene.body)) == (index == 0)
    late = result(0, shown=furnished(masks[0], 24))
    late = replace(late, effort=0.5, stamp_ns=late.stamp_ns + LATER_EVERY_NS)
    assert check.add(late, scene.body)


def test_the_warm_up_draws_the_body_as_a_comparison_does(
    scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []
    monkeypatch.setattr(
        static_silhouette, "body_masks",
        lambda body, pose, cameras: drawn.append((body, len(cameras))) or {},
    )  # fmt: skip
    StaticSilhouette(scene.rig).warm_up(scene.body)
    assert drawn == [(scene.body, len(list(scene.rig)))]
