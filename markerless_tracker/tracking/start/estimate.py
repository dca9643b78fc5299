"""What an automatic start found in one frame."""

from collections.abc import Mapping
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
    """

    searcher: Searcher
    pose: FloatArray
    observations: Mapping[str, Observation]
    settled: bool
    notes: tuple[str, ...] = ()
