"""What an automatic start found in one frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.search import Searcher


@dataclass(frozen=True, eq=False)
class StartEstimate:
    """What an automatic start found in one frame.

    Attributes:
        searcher: searches with the body found so far.
        pose: (p,).
        observations: the parts of the silhouettes that belong to this person.
        settled: whether the start is complete.
        notes: messages for the user, one line each.
        rest: completes a start whose last frame this is; takes some tenths of a second. None if
            there is nothing to complete.
        predicted: whether the pose is that of an earlier frame, and must be refined in this one.
        continued: whether it continues the pose of the last frame.
    """

    searcher: Searcher
    pose: FloatArray
    observations: Mapping[str, Observation]
    settled: bool
    notes: tuple[str, ...] = ()
    rest: Callable[[], "StartEstimate"] | None = None
    predicted: bool = False
    continued: bool = False
