"""The body over the images of a result."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import FrameSet
from markerless_tracker.drawing import draw_overlay
from markerless_tracker.results.read import read_result
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.overlays import Overlays, chosen_rows, spread_rows


@pytest.fixture
def overlays(make_result, walk: Path) -> Overlays:
    result = read_result(make_result(source=walk, lost=(3,)))
    return Overlays(result, ResultImages(result))


def test_the_body_lies_over_the_person(overlays: Overlays, seen) -> None:
    (_, pictures), (_, without) = overlays.pictures([2, 3])
    assert sorted(pictures) == ["cam01", "cam02", "cam03", "cam04"]
    camera = seen.rig["cam01"]
    plain = seen.frame(2)[0]["cam01"]
    sd = np.full((15, 3), 0.02)
    expected = draw_overlay(plain, camera, seen.body, seen.pose(2), markers_sd_m=sd)
    # Fewer points on the outlines: some pixels of the lines lie beside.
    assert (np.abs(pictures["cam01"].astype(int) - expected) > 60).any(axis=2).mean() < 0.004
    assert (np.abs(pictures["cam01"].astype(int) - plain) > 60).any(axis=2).mean() > 0.01
    np.testing.assert_array_equal(without["cam01"], seen.frame(3)[0]["cam01"])


def test_sheets_name_time_and_state(overlays: Overlays) -> None:
    assert overlays.caption(2) == "0.067 s  TRACKING" and overlays.caption(3) == "0.100 s  LOST"
    (row, sheet), (_, other) = overlays.sheets([2, 3], width_px=300)
    assert row == 2 and sheet.shape == other.shape and sheet.shape[1] <= 300
    whole = overlays.contact_sheet([0, 2, 5], width_px=640)
    assert whole.shape[1] <= 640 and whole.shape[0] > sheet.shape[0]


def test_a_camera_without_an_image_is_black(overlays: Overlays, seen) -> None:
    images = {name: image for name, image in seen.frame(2)[0].items() if name != "cam02"}
    drawn = overlays._drawn(2, FrameSet(2, seen.stamp_ns(2), images))
    assert sorted(drawn) == ["cam01", "cam02", "cam03", "cam04"]
    assert not drawn["cam02"].any() and drawn["cam01"].any()


def test_rows_to_show() -> None:
    assert chosen_rows(7, 10) == list(range(7))
    assert chosen_rows(7, 4) == [0, 2, 4, 6] and chosen_rows(7, 3) == [0, 3, 6]
    assert spread_rows(7, 3) == [0, 3, 6] and spread_rows(7, 20) == list(range(7))
