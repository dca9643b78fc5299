"""Named marker positions over time, as in a motion-capture file or a result."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import locked

PELVIS = "Pelvis"
HIPS = ("LHip", "RHip")


@dataclass(frozen=True, eq=False)
class MarkerTrack:
    """Markers over time, in the world frame (Z up).

    Attributes:
        names: (m,) distinct marker names.
        stamps_ns: (n,) int64, strictly increasing.
        positions_m: (n, m, 3) in m, world frame; NaN = missing (a marker is missing as a whole).

    Raises:
        DatasetError: shapes disagree, names repeat or stamps do not increase.
    """

    names: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    positions_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "stamps_ns", locked(self.stamps_ns, np.int64))
        positions = np.array(self.positions_m, dtype=np.float64)
        expected = (self.stamps_ns.size, len(self.names), 3)
        if self.stamps_ns.ndim != 1 or positions.shape != expected:
            raise DatasetError(
                f"marker positions have shape {positions.shape}, expected {expected}"
            )
        positions[~np.isfinite(positions).all(axis=2)] = np.nan
        object.__setattr__(self, "positions_m", locked(positions, np.float64))
        if len(set(self.names)) != len(self.names):
            raise DatasetError(f"marker names must be distinct, got {', '.join(self.names)}")
        if (np.diff(self.stamps_ns) <= 0).any():
            row = int(np.argmax(np.diff(self.stamps_ns) <= 0)) + 1
            raise DatasetError(
                f"marker times must increase, row {row + 1} is at {self.stamps_ns[row] / 1e9} s "
                f"after {self.stamps_ns[row - 1] / 1e9} s"
            )

    def __len__(self) -> int:
        return int(self.stamps_ns.size)

    @property
    def tracked(self) -> NDArray[np.bool_]:
        """(n,) whether a row has any marker."""
        return np.asarray(np.isfinite(self.positions_m[..., 0]).any(axis=1))

    def selected(self, names: Sequence[str]) -> "MarkerTrack":
        """The track with those markers only, in the order given.

        Raises:
            DatasetError: the track has no such marker.
        """
        missing = [name for name in names if name not in self.names]
        if missing:
            raise DatasetError(
                f"no marker {', '.join(missing)}, expected names among {', '.join(self.names)}"
            )
        columns = [self.names.index(name) for name in names]
        return MarkerTrack(tuple(names), self.stamps_ns, self.positions_m[:, columns])

    def rows(self, rows: slice | NDArray[np.int64]) -> "MarkerTrack":
        """The track with those rows only."""
        return MarkerTrack(self.names, self.stamps_ns[rows], self.positions_m[rows])

    def with_pelvis(self) -> "MarkerTrack":
        """The track with a Pelvis: its own, else the midpoint of the hips if it has both."""
        if PELVIS in self.names or not set(HIPS) <= set(self.names):
            return self
        middle = self.positions_m[:, [self.names.index(name) for name in HIPS]].mean(axis=1)
        return MarkerTrack(
            (*self.names, PELVIS),
            self.stamps_ns,
            np.concatenate([self.positions_m, middle[:, None]], axis=1),
        )
