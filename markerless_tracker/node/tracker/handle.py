"""The tracker as the tracking thread uses it, and what it makes of a set."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.imaging import BackgroundModel
from markerless_tracker.node.tracker.pace.waiting import AT_MOST
from markerless_tracker.records import Observation, TrackResult

Images = Mapping[str, NDArray[np.uint8] | Observation]


class Stepper(Protocol):
    """The part of `tracking.Tracker` that the worker uses."""

    @property
    def body(self) -> BodyModel:
        """The tracked body."""

    @property
    def rig(self) -> CameraRig:
        """The cameras of the scaled images, as corrected so far."""

    def warm_up(self) -> None:
        """Compile all kernels of a step."""

    def prepare(self, views: Mapping[str, Any], stamp_ns: int) -> Any:
        """Make the evidence of the next set while one is tracked."""

    def step(self, views: Any, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        """Track one set of images, or a prepared set."""

    def reset(self) -> None:
        """Forget the person."""

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use other backgrounds from now on, and forget the person."""


@dataclass(frozen=True)
class TrackedSet:
    """A result, and the scaled images or evidence that it was made from.

    Attributes:
        body: the estimate of the body at that time.
        rig: the cameras as corrected at that time.
    """

    result: TrackResult
    images: Images
    body: BodyModel
    rig: CameraRig


@dataclass(frozen=True)
class TrackerHandle:
    """The worker's tracker, and how to use it.

    Attributes:
        tracker: the tracker.
        start_ns: see `StartTimeGate`.
        decode: makes the tracker's image or observation of a camera's view.
        waits: whether the tracker has no backgrounds; sets are dropped until they are learned.
        warm_up: compiles what the node uses besides the tracker.
        kept: number of sets that are kept during the search for a person.
        searches: whether the tracker begins with a search, without a start pose.
    """

    tracker: Stepper
    start_ns: int | None
    decode: Callable[[str, Any], NDArray[np.uint8] | Observation]
    waits: bool = False
    warm_up: Callable[[], None] = lambda: None
    kept: int = AT_MOST
    searches: bool = True
