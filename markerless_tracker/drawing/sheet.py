"""Contact sheet of several named pictures."""

from collections.abc import Mapping

import cv2
import numpy as np

from markerless_tracker.drawing.overlay import Image
from markerless_tracker.errors import ImageError

_BAR_PX = 22
_GAP_PX = 4


def overlay_sheet(
    images: Mapping[str, Image], *, columns: int | None = None, max_width_px: int = 1920
) -> Image:
    """A mosaic (h, w, 3) BGR of named pictures, each under a bar with its name.

    Pictures (h, w, 3) or (h, w) keep their aspect ratio and are scaled to the height of the
    tallest. By default there are as many columns as rows. The sheet is scaled down to the maximum
    width.

    Raises:
        ImageError: there is no picture, or one of them is empty.
    """
    if not images:
        raise ImageError("overlay sheet: got no picture, expected at least one")
    for name, image in images.items():
        if image.ndim not in (2, 3) or image.size == 0:
            raise ImageError(
                f"{name}: picture of shape {image.shape}, expected (h, w) or (h, w, 3)"
            )
    columns = columns or int(np.ceil(np.sqrt(len(images))))
    height = max(image.shape[0] for image in images.values())
    widest = max(round(image.shape[1] * height / image.shape[0]) for image in images.values())
    shrink = min(1.0, (max_width_px / columns - _GAP_PX) / widest)
    height, widest = max(1, round(height * shrink)), max(1, round(widest * shrink))
    tiles = [_tile(name, image, height, widest) for name, image in images.items()]
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    return np.ascontiguousarray(np.vstack(rows))


def _tile(name: str, image: Image, height: int, width: int) -> Image:
    tile = np.zeros((height + _BAR_PX + _GAP_PX, width + _GAP_PX, 3), dtype=np.uint8)
    picture = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    factor = height / picture.shape[0]
    size = (min(width, max(1, round(picture.shape[1] * factor))), height)
    tile[_BAR_PX : _BAR_PX + height, : size[0]] = cv2.resize(
        picture, size, interpolation=cv2.INTER_AREA if factor < 1.0 else cv2.INTER_LINEAR
    )
    cv2.putText(
        tile,
        name,
        (4, _BAR_PX - 7),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.45,
        (230, 230, 230),
        1,
        cv2.LINE_AA,
    )
    return tile
