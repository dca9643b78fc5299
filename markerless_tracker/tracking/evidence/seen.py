"""The evidence of one frame, as the searches use it."""

from collections.abc import Mapping
from dataclasses import dataclass

from markerless_tracker.records import Observation


@dataclass(frozen=True, eq=False)
class Seen:
    """The evidence of one frame.

    Attributes:
        stamp_ns: its time.
        observed: the observations of all cameras.
        used: those of the usable cameras; undecided pixels near the predicted body are decided,
            unless the body is lost or an automatic start searches it.
        imaged: those of the usable cameras, with the undecided pixels that imaging left.
        notes: a line for each camera that is left out from now on, or used again.
        left_out: a line for each camera with silhouette parts that are left out.
    """

    stamp_ns: int
    observed: Mapping[str, Observation]
    used: Mapping[str, Observation]
    imaged: Mapping[str, Observation]
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
