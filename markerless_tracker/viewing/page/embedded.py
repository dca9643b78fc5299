"""The film that is embedded in the page."""

import io
import math
from collections.abc import Callable, Iterator

import cv2

from markerless_tracker.drawing.overlay import Image
from markerless_tracker.errors import DatasetError
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.viewing.film import write_film
from markerless_tracker.viewing.images import ResultImages
from markerless_tracker.viewing.overlays import Overlays, spread_rows
from markerless_tracker.viewing.page.report import Film, duration_s

WIDTH_PX, IMAGE_PX = 960, 476
"""Width of the pictures, and of the images in them. Two images side by side need no rescaling."""
MOST_FPS, MOST_FRAMES = 30.0, 300
"""Limits of a film. Of results beyond them, every k-th frame is shown."""
MOST_BYTES = 12_000_000
"""Limit of the bytes of all films of a page, before base64 encoding."""
MOST_BIT_RATE = 3_000_000

_STILL_QUALITY = 80
_STILLS = 3


def embedded_film(
    result: StoredResult,
    images: ResultImages,
    *,
    films: int = 1,
    progress: Callable[[int, int], None] = lambda done, most: None,
) -> Film:
    """A film of a result in real time, and a still picture.

    Args:
        result: the result.
        images: its images.
        films: number of films on the page, which share `MOST_BYTES`.
        progress: called with the number of pictures drawn and their total.

    Raises:
        ConfigError: PyAV is not installed.
        DatasetError: no frame has images.
    """
    overlays = Overlays(result, images)
    step = max(math.ceil(result.fps / MOST_FPS - 1e-6), math.ceil(len(result) / MOST_FRAMES))
    rows = list(range(0, len(result), step))
    fps = result.fps / step
    seconds = max(duration_s(result), 0.1)
    stills = {rows[i] for i in spread_rows(len(rows), _STILLS)}
    kept: list[Image] = []

    def pictures() -> Iterator[tuple[float, Image]]:
        for number, (row, sheet) in enumerate(overlays.sheets(rows, width_px=WIDTH_PX)):
            if row in stills or not kept:
                kept.append(sheet)
            progress(number + 1, len(rows))
            yield float(result.times_s[row]), sheet

    buffer = io.BytesIO()
    bit_rate = min(MOST_BIT_RATE, int(8 * MOST_BYTES / films / seconds))
    frames = write_film(buffer, pictures(), fps=fps, bit_rate=bit_rate)
    done, still = cv2.imencode(
        ".jpg", cv2.vconcat(kept), [cv2.IMWRITE_JPEG_QUALITY, _STILL_QUALITY]
    )
    if not done:
        raise DatasetError("the film's still picture cannot be encoded")
    return Film(buffer.getvalue(), still.tobytes(), frames)
