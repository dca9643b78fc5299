"""Image messages as arrays."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from markerless_tracker.datasets.bag.encodings import (
    ENCODINGS,
    compressed_layout,
    decode_compressed,
    decode_raw,
    decoded_channels,
)
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
    with pytest.raises(ImageError, match="cam01.*bayer_rggb16.*bgr8"):
        decoded(BGR, "bayer_rggb16")


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_bayer_pattern(pattern: str, padding: int) -> None:
    colour = np.array([200, 90, 30], np.uint8)  # BGR
    letters = np.resize(np.array(list(pattern)).reshape(2, 2), (2, 2))
    cell = np.array([[colour["bgr".index(c)] for c in row] for row in letters], np.uint8)
    image = decoded(np.tile(cell, (4, 5)), f"bayer_{pattern}8", padding=padding)
    np.testing.assert_array_equal(image, np.full((8, 10, 3), colour))
    assert decoded_channels(f"bayer_{pattern}8") == 3


@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize(
    ("encodings", "order"), [(("uyvy", "yuv422"), "uyvy"), (("yuyv", "yuv422_yuy2"), "yuyv")]
)
def test_yuv_422(encodings: tuple[str, ...], order: str, padding: int) -> None:
    colour = np.full((1, 1, 3), [200, 90, 30], np.uint8)
    y, u, v = cv2.cvtColor(colour, cv2.COLOR_BGR2YUV)[0, 0].astype(float)
    y, u, v = 16 + y * 219 / 255, 128 + (u - 128) * 224 / 255, 128 + (v - 128) * 224 / 255
    values = {"y": y, "u": u, "v": v}
    pair = np.array([round(values[letter]) for letter in order], np.uint8).reshape(1, 2, 2)
    stored = np.tile(pair, (3, 4, 1))
    for encoding in encodings:
        image = decoded(stored, encoding, padding=padding)
        assert image.shape == (3, 8, 3) and decoded_channels(encoding) == 3
        assert np.abs(image.astype(int) - colour).max() <= 30
        assert image[0, 0].argmax() == 0 and image[0, 0].argmin() == 2
    with pytest.raises(
        ImageError, match=f"cam01: 7x3 px cannot be {encodings[0]}, expected an even"
    ):
        decoded(stored[:, :7], encodings[0])


@pytest.mark.parametrize("end", [".png", ".jpg"])
@pytest.mark.parametrize("channels", [1, 3])
def test_the_layout_of_a_compressed_image_is_that_of_the_decoded_one(
    end: str, channels: int
) -> None:
    image = BGR if channels == 3 else BGR[..., 0]
    data = cv2.imencode(end, image)[1].tobytes()
    assert compressed_layout(data, where="cam01") == (7, 5, channels)
    assert decode_compressed(data, where="cam01").shape == image.shape
    if end == ".png" and channels == 3:
        clear = cv2.imencode(end, np.dstack([BGR, BGR[..., 0]]))[1].tobytes()
        assert compressed_layout(clear, where="cam01").channels == 3
        assert decode_compressed(clear, where="cam01").shape == BGR.shape


@given(st.binary(max_size=60), st.sampled_from([b"", b"\xff\xd8", b"\x89PNG\r\n\x1a\n"]))
def test_any_bytes_have_a_layout_or_are_refused(data: bytes, start: bytes) -> None:
    try:
        compressed_layout(start + data, where="cam01")
    except ImageError as error:
        assert "cam01" in str(error) and "JPEG or PNG" in str(error)


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
