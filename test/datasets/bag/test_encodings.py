"""Image messages as arrays."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.datasets.bag.encodings import ENCODINGS, decode_compressed, decode_raw
from markerless_tracker.errors import ImageError

BGR = np.random.default_rng(3).integers(0, 256, (5, 7, 3), dtype=np.uint8)


def decoded(stored: np.ndarray, encoding: str, *, padding: int = 0) -> np.ndarray:
    height, width = stored.shape[:2]
    rows = stored.reshape(height, -1)
    rows = np.hstack([rows, np.full((height, padding), 99, np.uint8)])
    return decode_raw(
        rows.tobytes(),
        encoding=encoding,
        width=width,
        height=height,
        step=rows.shape[1],
        where="cam01",
    )


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "stored"),
    [
        ("bgr8", BGR),
        ("8UC3", BGR),
        ("rgb8", BGR[..., ::-1]),
        ("bgra8", np.dstack([BGR, BGR[..., 0]])),
        ("8UC4", np.dstack([BGR, BGR[..., 0]])),
        ("rgba8", np.dstack([BGR[..., ::-1], BGR[..., 0]])),
    ],
)
def test_colour(encoding: str, stored: np.ndarray, padding: int) -> None:
    np.testing.assert_array_equal(decoded(stored, encoding, padding=padding), BGR)


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_grey(encoding: str) -> None:
    image = decoded(BGR[..., 0], encoding, padding=3)
    assert image.shape == (5, 7)
    np.testing.assert_array_equal(image, BGR[..., 0])


def test_unknown_encodings_are_named() -> None:
    with pytest.raises(ImageError, match="cam01.*bayer_rggb8.*bgr8"):
        decoded(BGR, "bayer_rggb8")


@given(
    st.sampled_from(sorted(ENCODINGS)),
    st.integers(-2, 20),
    st.integers(-2, 20),
    st.integers(-2, 80),
    st.integers(0, 400),
)
def test_contradicting_sizes_are_refused_or_decoded_completely(encoding, width, height, step, size):
    try:
        image = decode_raw(
            bytes(size), encoding=encoding, width=width, height=height, step=step, where="cam01"
        )
    except ImageError as error:
        assert "cam01" in str(error)
    else:
        assert image.shape[:2] == (height, width) and size >= height * step


def test_compressed() -> None:
    png = cv2.imencode(".png", BGR)[1]
    np.testing.assert_array_equal(decode_compressed(png.tobytes(), where="cam01"), BGR)
    for broken in (b"", b"no image"):
        with pytest.raises(ImageError, match="cam01.*cannot be decoded"):
            decode_compressed(broken, where="cam01")
