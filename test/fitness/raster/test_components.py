"""Components of packed masks, compared with OpenCV's of the unpacked ones."""

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from markerless_tracker.fitness.raster.components import (
    Components,
    clear_components,
    components,
    touch_components,
)
from markerless_tracker.imaging import Region
from markerless_tracker.observation import pack_mask, unpack_mask

shapes = st.tuples(st.integers(1, 12), st.integers(1, 140))
masks = shapes.flatmap(lambda shape: arrays(np.bool_, shape))


def labels(parts: Components, shape: tuple[int, int]) -> np.ndarray:
    """(h, w) component of each pixel, counted from 1; 0 where none is."""
    out = np.zeros(shape, dtype=int)
    for row, begin, end, number in zip(parts.rows, *parts[1:4], strict=True):
        out[row, begin:end] = number + 1
    return out


@given(masks)
@example(np.ones((3, 128), dtype=bool))
@example(np.zeros((2, 64), dtype=bool))
@example(np.eye(70, dtype=bool))
def test_components_are_those_of_opencv(mask) -> None:
    parts = components(pack_mask(mask))
    count, expected, table, centres = cv2.connectedComponentsWithStats(mask.view(np.uint8))
    found = labels(parts, mask.shape)
    assert parts.total == count - 1
    np.testing.assert_array_equal(found > 0, mask)
    # Numbered in the order of their first pixels.
    first = [int(np.flatnonzero(found == n)[0]) for n in range(1, count)]
    assert first == sorted(first)
    own = expected.ravel()[first]
    for n, label in enumerate(own):
        np.testing.assert_array_equal(found == n + 1, expected == label)
    np.testing.assert_array_equal(parts.areas_px, table[own, cv2.CC_STAT_AREA])
    if count > 1:
        np.testing.assert_allclose(parts.centres_px, centres[own], atol=1e-9)


@given(masks, st.data())
def test_boxes_are_those_of_the_chosen_components(mask, data) -> None:
    parts = components(pack_mask(mask))
    chosen = data.draw(arrays(np.bool_, parts.total))
    found = labels(parts, mask.shape)
    for box, part in (
        (parts.box(), mask),
        (parts.box(chosen), np.isin(found, 1 + np.flatnonzero(chosen))),
    ):
        rows, columns = np.nonzero(part)
        if len(rows):
            # Not `cv2.boundingRect`: that of OpenCV 4.6 misses pixels beside the left border.
            assert box == Region(columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        else:
            assert box is None


@given(masks, st.data())
def test_only_kept_components_remain(mask, data) -> None:
    parts = components(pack_mask(mask))
    kept = data.draw(arrays(np.bool_, parts.total))
    other = data.draw(arrays(np.bool_, mask.shape))
    words = pack_mask(other)
    count = clear_components(parts, kept, words)
    cleared = np.isin(labels(parts, mask.shape), 1 + np.flatnonzero(~kept))
    np.testing.assert_array_equal(unpack_mask(words, mask.shape[1]), other & ~cleared)
    assert count == (other & cleared).sum()


@given(masks, st.data())
def test_touched_components_are_marked(mask, data) -> None:
    parts = components(pack_mask(mask))
    other = data.draw(arrays(np.uint8, mask.shape, elements=st.sampled_from([0, 0, 0, 1, 255])))
    touched = np.zeros(parts.total, dtype=bool)
    touch_components(parts, other, touched)
    found = labels(parts, mask.shape)
    assert [n for n in range(parts.total) if other[found == n + 1].any()] == list(
        np.flatnonzero(touched)
    )


@pytest.mark.parametrize("width", [63, 64, 65, 128])
def test_runs_across_words_are_whole(width) -> None:
    parts = components(pack_mask(np.ones((1, width), dtype=bool)))
    assert (parts.begin.tolist(), parts.end.tolist(), parts.total) == ([0], [width], 1)
