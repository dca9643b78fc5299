from pathlib import Path
from typing import Any

import numpy as np
import pytest

from markerless_tracker.imaging import BackgroundModel, ImagingSettings, read_background_model
from markerless_tracker.node.tracker.learning import PATIENCE_S, Learning, OpenRequest
from markerless_tracker.records import TrackState

CAMERAS = ("cam01", "cam02")
SIZE = (120, 160)


class Taker:
    """Takes the place of the tracker."""

    def __init__(self) -> None:
        self.got: dict[str, BackgroundModel] = {}

    def take_backgrounds(self, backgrounds: Any) -> None:
        self.got = dict(backgrounds)


def room(seed: int, gain: float = 1.0, *, sigma: float = 3.0) -> np.ndarray:
    """An empty room with the sensor's noise."""
    wall = np.tile(np.linspace(40.0, 180.0, SIZE[1]), (SIZE[0], 1))[:, :, None].repeat(3, axis=2)
    noise = np.random.default_rng(seed).normal(0.0, sigma, wall.shape)
    return np.clip(gain * wall + noise, 0, 255).astype(np.uint8)


def collect(learning: Learning, taker: Taker, sets: list[dict[str, Any]]) -> None:
    for images in sets:
        learning.take(images)
        if learning.searches_person:
            learning.saw(TrackState.SEARCHING)
        learning.finish_if_complete(taker)


def sets_of(count: int, **changes: Any) -> list[dict[str, Any]]:
    return [{name: room(10 * i + k) for k, name in enumerate(CAMERAS)} for i in range(count)]


def test_an_empty_room_is_learned_and_written(tmp_path: Path) -> None:
    learning, taker = Learning(CAMERAS, 6, ImagingSettings(), tmp_path / "new"), Taker()
    collect(learning, taker, sets_of(5))
    assert not learning.answered and not taker.got
    collect(learning, taker, sets_of(1))
    assert learning.success and "written to" in learning.message
    for name in CAMERAS:
        written = read_background_model(tmp_path / "new" / f"{name}.npz")
        np.testing.assert_array_equal(written.mean, taker.got[name].mean)
        assert abs(written.mean - room(0, sigma=0.0)).mean() < 2.0
        assert 4.0 < np.median(written.variance) < 16.0


@pytest.mark.parametrize("gain", [0.8, 1.25])
def test_a_change_of_brightness_is_no_motion(gain: float) -> None:
    learning, taker = Learning(("cam01",), 3, ImagingSettings(), None), Taker()
    collect(learning, taker, [{"cam01": room(i, gain if i == 1 else 1.0)} for i in range(3)])
    assert learning.success, learning.message


def test_motion_is_refused_and_named() -> None:
    learning, taker = Learning(CAMERAS, 3, ImagingSettings(), None), Taker()
    sets = sets_of(3)
    sets[1]["cam02"][30:90, 40:60] = 230
    collect(learning, taker, sets)
    assert learning.answered and not learning.success and not taker.got
    assert learning.message.startswith("nothing learned: cam02: 8.")


@pytest.mark.parametrize("which", [0, -1])
def test_a_person_in_the_first_or_the_last_set_is_refused(which: int) -> None:
    learning, taker = Learning(CAMERAS, 3, ImagingSettings(), None), Taker()
    sets = sets_of(3)
    for images in sets:
        learning.take(images)
        if learning.searches_person:
            there = images is sets[which]
            learning.saw(TrackState.TRACKING if there else TrackState.SEARCHING)
        learning.finish_if_complete(taker)
    assert learning.message.startswith("nothing learned: a person is tracked") and not taker.got


def test_a_camera_that_stops_is_named() -> None:
    learning, taker = Learning(CAMERAS, 3, ImagingSettings(), None), Taker()
    sets = sets_of(3)
    del sets[1]["cam02"]
    collect(learning, taker, sets)
    assert learning.message == "nothing learned: cam02: 2 of 3 images were received, expected all"
    assert not taker.got


def test_a_request_without_images_fails_after_a_while() -> None:
    now_s = [5.0]
    learning = Learning(CAMERAS, 3, ImagingSettings(), None, clock=lambda: now_s[0])
    learning.refuse_if_overdue("tracking")
    assert not learning.answered
    now_s[0] += PATIENCE_S + 0.1
    learning.refuse_if_overdue("waiting for images")
    assert learning.message == (
        "nothing learned: 0 of 3 sets of images were received, then none for 10 s "
        "(waiting for images)"
    )


def test_a_background_that_cannot_be_written_is_used_and_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file")
    learning, taker = Learning(CAMERAS, 2, ImagingSettings(), tmp_path / "file"), Taker()
    collect(learning, taker, sets_of(2))
    assert taker.got and learning.answered and not learning.success
    assert "in use, but not saved" in learning.message and "\n" not in learning.message


def test_a_request_that_follows_an_answered_one_is_kept() -> None:
    """The end of the first must not discard the second, whose caller would wait for ever."""
    request = OpenRequest()
    first, second, third = (Learning(CAMERAS, 2, ImagingSettings(), None) for _ in range(3))
    request.open(first)
    assert request.current is first
    first.refuse("a person")
    request.open(second)
    assert request.current is second
    request.open(third)
    assert third.answered and "already" in third.message and request.current is second
    second.refuse("the tracker ends")
    assert request.current is None
