"""Rows at a constant rate, for formats without times."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import DatasetError
from markerless_tracker.results.read import ResultReader
from markerless_tracker.results.stored_result import StoredResult

LONGEST_GAP = 1_000_000
"""Frames that may be missing between two rows."""


@dataclass(frozen=True, eq=False)
class GridPart:
    """Consecutive frames of a grid.

    Attributes:
        part: rows of the result.
        rows: (k,) row of `part` at each of k frames of the grid, -1 where there is none.
    """

    part: StoredResult
    rows: NDArray[np.int64]


class Grid:
    """A result at its constant rate: a row lies at the frame nearest to its time.

    Of two rows at one frame the first counts; frames without a row are empty. The first row is at
    frame 0.

    Args:
        reader: the result.

    Attributes:
        fps: frames per second.
        left_out: rows without a frame of their own, known after `parts`.
        most_off_s: largest difference of a row's time from its frame's, known after `parts`.
        first_ns: stamp of the first row, 0 without any; known after `parts` began.
    """

    def __init__(self, reader: ResultReader) -> None:
        self._reader = reader
        self.fps = reader.fps
        self.left_out, self.most_off_s, self.first_ns = 0, 0.0, 0

    def frames(self) -> int:
        """Number of frames, by a pass over the result."""
        return sum(len(part.rows) for part in self.parts())

    def parts(self) -> Iterator[GridPart]:
        """The grid, in order.

        Raises:
            DatasetError: more than `LONGEST_GAP` frames are missing between two rows.
        """
        self.left_out, self.most_off_s, self.first_ns = 0, 0.0, 0
        last, first = -1, None
        for part in self._reader.chunks():
            if not len(part):
                continue
            if first is None:
                first = self.first_ns = int(part.stamps_ns[0])
            exact = (part.stamps_ns - first) * (self.fps / 1e9)
            frames = np.rint(exact).astype(np.int64)
            if np.diff(frames, prepend=last).max() > LONGEST_GAP:
                raise DatasetError(
                    f"{self._reader.name}: a gap of more than {LONGEST_GAP} frames at "
                    f"{self.fps:g} Hz cannot be written at a constant rate"
                )
            kept = np.flatnonzero(np.diff(np.maximum.accumulate(frames), prepend=last) > 0)
            self.left_out += len(frames) - len(kept)
            off = float(np.abs(exact - frames)[kept].max(initial=0.0)) / self.fps
            self.most_off_s = max(self.most_off_s, off)
            if not len(kept):
                continue
            rows = np.full(frames[kept[-1]] - last, -1, dtype=np.int64)
            rows[frames[kept] - last - 1] = kept
            last = int(frames[kept[-1]])
            yield GridPart(part, rows)
