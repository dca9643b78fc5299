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
        {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "32"},
        {},
    ),
    # With B-frames the muxer of MP4 states too short a duration if a gap is near the end.
    "mp4": ("libx264", {"preset": "veryfast", "crf": "25", "bf": "0"}, {"movflags": "faststart"}),
}

_TICKS_PER_S = 1000
"""Least resolution of the times of pictures, that of WebM."""


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
    pictures: Iterable[tuple[float, Image]],
    *,
    fps: float,
    container: str = "webm",
    bit_rate: int | None = None,
) -> int:
    """Write pictures as a film; returns their number. A file is replaced when the film is complete.

    Args:
        target: path of a file, or a binary file open for writing.
        pictures: time in s and (h, w, 3) BGR; times increase, and pictures are all of one size. An
            odd last row or column is left out. A picture is shown until the time of the next one.
        fps: usual number of pictures per second; the last picture is shown for 1 / fps.
        container: one of `FORMATS`.
        bit_rate: largest mean rate in bit/s; None = unlimited, at constant quality.

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
    pictures: Iterable[tuple[float, Image]],
    fps: float,
    container: str,
    bit_rate: int | None,
) -> int:
    codec, options, muxer = _CODECS[container]
    rate = Fraction(fps).limit_denominator(1000)
    # A whole number of ticks per period, so that evenly spaced pictures stay evenly spaced.
    period = max(1, round(_TICKS_PER_S / rate))
    count, pts, start_s = 0, 0, 0.0
    try:
        with av.open(sink, "w", format=container, options=muxer) as film:
            stream = film.add_stream(
                codec, rate=rate, options={**options, **_rate_options(container, bit_rate)}
            )
            stream.pix_fmt = "yuv420p"
            stream.codec_context.time_base = 1 / (rate * period)
            for time_s, picture in pictures:
                height, width = (side // 2 * 2 for side in picture.shape[:2])
                if not count:
                    stream.width, stream.height, start_s = width, height, time_s
                even = np.ascontiguousarray(picture[:height, :width])
                frame = av.VideoFrame.from_ndarray(even, format="bgr24")
                pts = max(pts + 1 if count else 0, round((time_s - start_s) * rate * period))
                frame.pts, frame.time_base = pts, stream.codec_context.time_base
                frame.duration = period
                film.mux(stream.encode(frame))
                count += 1
            if count:
                film.mux(stream.encode())
    except (OSError, av.FFmpegError) as error:
        raise DatasetError(f"{where}: cannot be written: {error}") from error
    if not count:
        raise DatasetError(f"{where}: no image of the result, expected some of its source")
    return count


def _rate_options(container: str, bit_rate: int | None) -> dict[str, str]:
    """Options of the codec that limit the bit rate."""
    if container == "webm":
        return {"b": str(bit_rate or 0)}
    return {} if bit_rate is None else {"maxrate": str(bit_rate), "bufsize": str(bit_rate)}
