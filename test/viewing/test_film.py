"""Films, read back."""

import io
import sys
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.errors import ConfigError, DatasetError
from markerless_tracker.viewing.film import write_film

av = pytest.importorskip("av", reason="PyAV is not installed: pip install av")


def pictures(count: int, *, fps: float = 10.0) -> list[tuple[float, np.ndarray]]:
    """Times and pictures, evenly spaced."""
    return [
        (index / fps, np.full((65, 97, 3), (200, 20 * index, 40), np.uint8))
        for index in range(count)
    ]


def times_s(path: Path) -> list[float]:
    """Times of a film's pictures."""
    with av.open(str(path)) as film:
        return [frame.time for frame in film.decode(video=0)]


@pytest.mark.parametrize(("container", "codec"), [("webm", "vp9"), ("mp4", "h264")])
def test_a_film_is_read_back(tmp_path: Path, container: str, codec: str) -> None:
    path = tmp_path / f"a.{container}"
    assert write_film(path, pictures(6, fps=12.5), fps=12.5, container=container) == 6
    with av.open(str(path)) as film:
        (stream,) = film.streams.video
        assert stream.codec_context.name.startswith((codec, f"lib{codec}"))
        assert (stream.width, stream.height) == (96, 64)
        frames = [frame.to_ndarray(format="bgr24") for frame in film.decode(stream)]
        assert float(stream.average_rate) == pytest.approx(12.5)
    assert len(frames) == 6
    for index, frame in enumerate(frames):
        assert np.abs(frame[32, 48].astype(int) - (200, 20 * index, 40)).max() < 12


def test_a_film_in_memory() -> None:
    buffer = io.BytesIO()
    assert write_film(buffer, pictures(2), fps=10.0, bit_rate=100_000) == 2
    assert buffer.getvalue()[:4] == b"\x1aE\xdf\xa3", "the beginning of WebM"


@pytest.mark.parametrize("container", ["webm", "mp4"])
def test_pictures_have_their_own_times(tmp_path: Path, container: str) -> None:
    path = tmp_path / f"a.{container}"
    even = pictures(6, fps=30.0)
    write_film(path, even, fps=30.0, container=container)
    np.testing.assert_allclose(times_s(path), [time_s for time_s, _ in even], atol=0.6e-3)
    stamps_s = 7.0 + np.array([0, 1, 3, 4, 90, 92]) / 30.0
    uneven = [(float(time_s), picture) for time_s, (_, picture) in zip(stamps_s, even, strict=True)]
    write_film(path, uneven, fps=30.0, container=container)
    np.testing.assert_allclose(times_s(path), stamps_s - 7.0, atol=0.6e-3)
    with av.open(str(path)) as film:
        assert film.duration / 1e6 == pytest.approx(93 / 30, abs=2e-3)


@pytest.mark.parametrize("container", ["webm", "mp4"])
def test_the_bit_rate_is_limited(tmp_path: Path, container: str) -> None:
    path, random = tmp_path / f"a.{container}", np.random.default_rng(1)
    noise = [(index / 30, random.integers(0, 255, (120, 160, 3), np.uint8)) for index in range(60)]
    sizes = []
    for bit_rate in (None, 800_000, 200_000):
        write_film(path, noise, fps=30.0, container=container, bit_rate=bit_rate)
        sizes.append(path.stat().st_size)
    assert sizes[0] > 1.5 * sizes[1] > 2.0 * sizes[2]


@pytest.mark.parametrize("container", ["webm", "mp4"])
def test_a_film_that_is_not_completed_replaces_nothing(tmp_path: Path, container: str) -> None:
    path = tmp_path / f"a.{container}"
    path.write_bytes(b"earlier")

    def interrupted():
        yield from pictures(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(path, interrupted(), fps=10.0, container=container)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == b"earlier"


def test_what_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DatasetError, match="^the film: no image of the result"):
        write_film(io.BytesIO(), [], fps=10.0)
    with pytest.raises(ConfigError, match="film 'avi', expected one of webm, mp4"):
        write_film(io.BytesIO(), pictures(1), fps=10.0, container="avi")
    with pytest.raises(DatasetError, match="cannot be written"):
        write_film(tmp_path / "none" / "a.webm", pictures(1), fps=10.0)
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(ConfigError, match="pip install av"):
        write_film(io.BytesIO(), pictures(1), fps=10.0)
