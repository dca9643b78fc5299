"""Contact sheets of named pictures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from markerless_tracker.drawing import overlay_sheet
from markerless_tracker.errors import ImageError


def flat(value, width=40, height=30):
    return np.full((height, width, 3), value, dtype=np.uint8)


def test_two_by_two_in_order() -> None:
    sheet = overlay_sheet({name: flat(50 * i + 50) for i, name in enumerate("abcd")})
    height, width = sheet.shape[0] // 2, sheet.shape[1] // 2
    centres = [sheet[y * height + 37, x * width + 20, 0] for y in (0, 1) for x in (0, 1)]
    assert centres == [50, 100, 150, 200]
    # The names stand above.
    assert sheet[:20].max() > 150


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 90), st.integers(1, 90)), min_size=1, max_size=7),
    st.none() | st.integers(1, 4),
)
def test_any_sizes_fit(sizes, columns) -> None:
    images = {f"cam{i}": flat(200, w, h) for i, (w, h) in enumerate(sizes)}
    sheet = overlay_sheet(images, columns=columns, max_width_px=300)
    assert sheet.dtype == np.uint8 and sheet.ndim == 3 and sheet.shape[1] <= 300
    assert (sheet == 200).any()


def test_grey_pictures() -> None:
    assert (overlay_sheet({"a": flat(70)[..., 0]})[22:50, :38] == 70).all()


def test_no_pictures_and_empty_pictures() -> None:
    with pytest.raises(ImageError, match="got no picture"):
        overlay_sheet({})
    with pytest.raises(ImageError, match=r"cam01: picture of shape \(0, 5\)"):
        overlay_sheet({"cam01": np.zeros((0, 5), np.uint8)})
