"""Frames in which poses differ: which are kept, and how much the first counts."""

from typing import Any, cast

import numpy as np
import pytest

from markerless_tracker.body import BodyModel, load_description, subject_from_stature
from markerless_tracker.body.build import build_body
from markerless_tracker.tracking.person.varied import (
    FIRST_WEIGHT,
    MOST,
    VARIETY_RAD,
    VariedFrames,
)

CONTOURS = cast(Any, "contours")


@pytest.fixture(scope="module")
def body() -> BodyModel:
    description = load_description("person31")
    return build_body(description, subject_from_stature(description, 1.75))


def moved(body: BodyModel, angle: float) -> np.ndarray:
    pose = body.neutral.copy()
    pose[np.setdiff1d(body.joints, body.root)] += angle
    return pose


def test_only_poses_that_differ_from_all_kept_ones_are_taken(body: BodyModel) -> None:
    frames = VariedFrames(body, CONTOURS, body.neutral)
    assert not frames.takes(moved(body, 0.9 * VARIETY_RAD), body)
    assert frames.takes(moved(body, 1.1 * VARIETY_RAD), body)
    frames.add(CONTOURS, moved(body, 1.1 * VARIETY_RAD))
    assert not frames.takes(moved(body, 1.9 * VARIETY_RAD), body)
    assert frames.takes(moved(body, -1.1 * VARIETY_RAD), body)


def test_where_the_person_stands_and_faces_is_no_variety(body: BodyModel) -> None:
    frames = VariedFrames(body, CONTOURS, body.neutral)
    elsewhere = body.neutral.copy()
    elsewhere[body.root] += 3.0
    assert not frames.takes(elsewhere, body)


def test_the_first_frame_counts_most_and_room_is_bounded(body: BodyModel) -> None:
    frames = VariedFrames(body, CONTOURS, body.neutral)
    for number in range(1, MOST):
        pose = moved(body, 2.0 * number * VARIETY_RAD)
        assert frames.takes(pose, body)
        kept = frames.add(CONTOURS, pose)
    assert len(kept) == MOST
    assert [weight for _, _, weight in kept] == [FIRST_WEIGHT] + [1.0] * (MOST - 1)
    assert kept[0][1] is body.neutral
    assert not frames.takes(moved(body, 99.0), body)
