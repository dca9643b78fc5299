"""Films that browsers play: VP9 in WebM, H.264 in MP4, written with PyAV."""

import os
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import IO, Any

import numpy as np

from markerless_tracker.drawing.overlay import Image
from markerless_tracker.errors import ConfigError, DatasetError

FORMATS = ("webm", "mp4")
"""Containers: WebM holds VP9, MP4 holds H.264."""

# Fast settings, since overlays are for viewing, not for measurements.
_CODECS: dict[str, tuple[str, dict[str, str], dict[str, str]]] = {
    "webm": (
        "libvpx-vp9",
        {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "32", "b": "0"},
        {},
    ),
    "mp4": ("libx264", {"preset": "veryfast", "crf": "25"}, {"movflags": "faststart"}),
}


def require_av() -> Any:
    """PyAV.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import av
    except ImportError as error:
        raise ConfigError("films need PyAV: pip install av, or markerless_tracker[view]") from error
    return av


def write_film(
    target: Path | IO[bytes],
    pictures: Iterable[Image],
    *,
    fps: float,
    container: str = "webm",
    bit_rate: int | None = None,
) -> int:
    """Write pictures as a film; returns their number. A file is replaced when the film is complete.

    Args:
        target: path of a file, or a binary file open for writing.
        pictures: (h, w, 3) BGR, all of one size; an odd last row or column is left out.
        fps: pictures per second.
        container: one of `FORMATS`.
        bit_rate: largest rate in bit/s; None = unlimited, at constant quality.

    Raises:
        ConfigError: PyAV is not installed, or there is no such container.
        DatasetError: the film cannot be written, or there is no picture.
    """
    av = require_av()
    if container not in _CODECS:
        raise ConfigError(f"film {container!r}, expected one of {', '.join(FORMATS)}")
    if isinstance(target, Path):
        # The muxer of MP4 opens its file again, by its name.
        partial = target.with_name(f"{target.name}.tmp")
        try:
            count = _encode(av, str(partial), str(target), pictures, fps, container, bit_rate)
            os.replace(partial, target)
        except OSError as error:
            raise DatasetError(f"{target}: cannot be written: {error.strerror}") from error
        finally:
            partial.unlink(missing_ok=True)
        return count
    return _encode(av, target, "the film", pictures, fps, container, bit_rate)


def _encode(
    av: Any,
    sink: str | IO[bytes],
    where: str,
    pictures: Iterable[Image],
    fps: float,
    container: str,
    bit_rate: int | None,
) -> int:
    codec, options, muxer = _CODECS[container]
    count = 0
    try:
        with av.open(sink, "w", format=container, options=muxer) as film:
            stream = film.add_stream(
                codec, rate=Fraction(fps).limit_denominator(1000), options=options
            )
            stream.pix_fmt = "yuv420p"
            if bit_rate is not None:
                stream.bit_rate = bit_rate
            for picture in pictures:
                height, width = (side // 2 * 2 for side in picture.shape[:2])
                if not count:
                    stream.width, stream.height = width, height
                even = np.ascontiguousarray(picture[:height, :width])
                film.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="bgr24")))
                count += 1
            if count:
                film.mux(stream.encode())
    except (OSError, av.FFmpegError) as error:
        raise DatasetError(f"{where}: cannot be written: {error}") from error
    if not count:
        raise DatasetError(f"{where}: no image of the result, expected some of its source")
    return count
