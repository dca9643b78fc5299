"""Pictures of a result: the body drawn over the images of each camera, for chosen frames."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from markerless_tracker.datasets import FrameSet
from markerless_tracker.drawing import draw_overlay, overlay_sheet
from markerless_tracker.drawing.outline import cone_surfaces
from markerless_tracker.drawing.overlay import Image, as_colour
from markerless_tracker.results.stored_result import StoredResult
from markerless_tracker.viewing.images import ResultImages

_END_POINTS = 32
"""Points on the ellipse of a cone's end: enough for a small picture."""


def chosen_rows(total: int, most: int) -> list[int]:
    """At most `most` of the rows of a result, evenly spaced, the first one included."""
    return list(range(0, total, max(1, -(-total // most))))


def spread_rows(total: int, count: int) -> list[int]:
    """`count` of the rows of a result, evenly spaced from the first to the last."""
    ends = np.linspace(0, total - 1, min(count, total))
    return sorted({int(row) for row in np.rint(ends)})


class Overlays:
    """Draws the body over images: left limbs cyan, right limbs yellow, ellipses of 2 sd.

    Args:
        result: the result; frames without a pose show the images alone, cameras without an image
            are black.
        images: its images.
        progress: called with the number of rows drawn and their total.

    Raises:
        BodyModelError, DatasetError: the result's body is not described.
    """

    def __init__(
        self,
        result: StoredResult,
        images: ResultImages,
        *,
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self._result, self._images, self._progress = result, images, progress
        self._body = result.body()
        self._surfaces = cone_surfaces(self._body, end_points=_END_POINTS, sections=1)

    def pictures(self, rows: list[int]) -> Iterator[tuple[int, Mapping[str, Image]]]:
        """Rows with their whole pictures (h, w, 3) BGR by camera."""
        for done, (row, images) in enumerate(self._images.frames(rows), start=1):
            yield row, self._drawn(row, images)
            if self._progress is not None:
                self._progress(done, len(rows))

    def sheets(self, rows: list[int], *, width_px: int = 960) -> Iterator[tuple[int, Image]]:
        """Rows with one picture (h, w, 3) BGR of all cameras, with time and state."""
        for row, pictures in self.pictures(rows):
            named = {
                f"{name}  {self.caption(row)}": self._images.windows[name].of(image)
                for name, image in pictures.items()
            }
            yield row, overlay_sheet(named, max_width_px=width_px)

    def contact_sheet(self, rows: list[int], *, width_px: int = 1920) -> Image:
        """One picture (h, w, 3) BGR with all cameras side by side for each row."""
        tiles: dict[str, Image] = {}
        cameras = 1
        for row, pictures in self.pictures(rows):
            cameras = max(cameras, len(pictures))
            for name, image in pictures.items():
                tiles[f"{name}  {self.caption(row)}"] = self._images.windows[name].of(image)
        return overlay_sheet(tiles, columns=cameras, max_width_px=width_px)

    def caption(self, row: int) -> str:
        """Time and state of a row."""
        filled = ", filled" if self._result.filled[row] else ""
        return f"{self._result.times_s[row]:.3f} s  {self._result.states[row]}{filled}"

    def _drawn(self, row: int, images: FrameSet) -> dict[str, Image]:
        pose = self._result.parameters[row]
        found = {}
        for camera in self._images.rig:
            image = images.images.get(camera.name)
            if image is None:
                width, height = camera.size_px
                found[camera.name] = np.zeros((height, width, 3), dtype=np.uint8)
            elif np.isfinite(pose).all():
                deviations = self._result.positions_sd_m[row]
                found[camera.name] = draw_overlay(
                    image,
                    camera,
                    self._body,
                    pose,
                    markers_sd_m=deviations,
                    surfaces=self._surfaces,
                )
            else:
                found[camera.name] = as_colour(image, camera)
        return found
