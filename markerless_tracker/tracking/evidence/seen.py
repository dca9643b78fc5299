"""The evidence of one frame, as it is searched."""

from collections.abc import Mapping
from dataclasses import dataclass

from markerless_tracker.records import Observation


@dataclass(frozen=True, eq=False)
class Seen:
    """The evidence of one frame.

    Attributes:
        stamp_ns: its time.
        observed: what each camera saw.
        used: the observations that are used; near the predicted body undecided pixels are
            decided.
        imaged: the same, with the undecided pixels that imaging alone left.
        notes: a line for each camera that is left out from now on, or used again.
        left_out: a line for each camera of whose silhouette parts are left out.
    """

    stamp_ns: int
    observed: Mapping[str, Observation]
    used: Mapping[str, Observation]
    imaged: Mapping[str, Observation]
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
