"""Silhouettes as images on disk."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.datasets import open_recording, write_image
from markerless_tracker.datasets.video.masks import masks_by_frame, read_mask
from markerless_tracker.errors import DatasetError

RED, GREEN, BLUE = (0, 0, 128), (0, 128, 0), (128, 0, 0)
"""Colours (BGR) of the first objects of a palette."""


@pytest.mark.parametrize("colour", [RED, GREEN, BLUE, (255, 255, 255), (0, 128, 128)])
def test_a_person_of_any_colour(make_recording, colour) -> None:
    image = np.zeros((48, 64, 3), np.uint8)
    image[10:20, 11:31] = colour
    folder = make_recording()
    path = folder / "masks" / "cam01" / "000002.png"
    write_image(path, image)
    expected = np.where(image.any(axis=2), 255, 0)
    np.testing.assert_array_equal(read_mask(path, (64, 48)), expected)
    (found,) = open_recording(folder).masks("cam01").values()
    np.testing.assert_array_equal(found, expected)
    # Columns 11 and 30 cover half a pixel of the smaller image.
    assert np.count_nonzero(read_mask(path, (32, 24))) == 5 * 11


def test_dark_pixels_are_background(tmp_path: Path) -> None:
    write_image(tmp_path / "0.png", np.full((48, 64, 3), 127, np.uint8))
    assert not read_mask(tmp_path / "0.png", (64, 48)).any()


def test_names_are_numbers_of_frames(tmp_path: Path) -> None:
    for name in ("000003", "10"):
        write_image(tmp_path / f"{name}.png", np.zeros((2, 2), np.uint8))
    assert masks_by_frame(tmp_path) == {3: tmp_path / "000003.png", 10: tmp_path / "10.png"}
    write_image(tmp_path / "img4.png", np.zeros((2, 2), np.uint8))
    with pytest.raises(DatasetError, match="img4.png: expected a frame number"):
        masks_by_frame(tmp_path)
