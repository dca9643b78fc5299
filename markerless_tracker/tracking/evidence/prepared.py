"""Evidence of a set made while the set before it is fitted, and the source of its regions.

The regions of set n follow from the pose of set n - 2: that of set n - 1 is not known yet while
evidence is made ahead. They do so without this pipeline, too, so that results are the same bytes.
"""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import TrackerError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image, Region
from markerless_tracker.records import Observation
from markerless_tracker.tracking.motion import MotionModel

Views = Mapping[str, Image | Observation]
"""The views of one time: camera name to its image, or to a ready-made observation."""


@dataclass(frozen=True, eq=False)
class Outlook:
    """State of the tracker after set n, from which the regions of set n + 2 follow.

    Attributes:
        number: number of sets processed so far; -1 and 0 for the two outlooks before the first set.
        rig: the cameras as corrected then.
        body: the tracked body.
        motion: a copy, which does not change.
        limits: (2, p) joint limits.
        searching: whether a person is searched in the whole views.
    """

    number: int
    rig: CameraRig
    body: BodyModel
    motion: MotionModel
    limits: FloatArray
    searching: bool

    def predicted(self, stamp_ns: int) -> tuple[FloatArray, float | None]:
        """The predicted pose (p,) at a time, and the margin around it, m; None for whole views."""
        margin_m = None if self.searching else self.motion.region_margin_m(stamp_ns)
        return self.motion.predict(stamp_ns, self.limits), margin_m


class SeenView(NamedTuple):
    """The segmented view of one camera.

    Attributes:
        observation: of a region or the whole frame, before components are selected.
        image: the image that was segmented; None for a ready-made observation.
        region: part of the frame in which the person's components are selected; None = whole frame.
        exposure: brightness of the image relative to its background, by channel.
    """

    observation: Observation
    image: Image | None
    region: Region | None
    exposure: tuple[float, ...] | None


@dataclass(frozen=True, eq=False)
class Prepared:
    """A set of views with evidence made ahead, for `Tracker.step`.

    Attributes:
        views: as given to `Tracker.prepare`; the images must not change until the step has ended.
        stamp_ns: their time.
        outlook: the outlook of the regions; None if no evidence was made ahead.
        seen: by camera; empty if no evidence was made ahead.
        number: of the prepared sets, in their order.
    """

    views: Views
    stamp_ns: int
    outlook: Outlook | None
    seen: Mapping[str, SeenView]
    number: int


Segment = Callable[[Views, int, Outlook], Mapping[str, SeenView]]


class Lookahead:
    """Assigns each set the outlook of its regions, whenever its evidence is made.

    `prepare` of the next set may run at any time during the step before it. Evidence of one set is
    made ahead; evidence of later sets is made in their step.

    Args:
        first, second: the outlooks before the first set, numbers -1 and 0.
    """

    def __init__(self, first: Outlook, second: Outlook) -> None:
        self._lock = threading.Lock()
        # Numbers of the sets that were prepared last, and processed last.
        self._prepared = self._done = 0
        self.restart(first, second)

    def restart(self, first: Outlook, second: Outlook) -> None:
        """Restart; evidence made ahead is not used."""
        with self._lock:
            self._previous, self._latest = first, second
            self._running = False
            self._done = self._prepared

    @property
    def current(self) -> Outlook:
        """The outlook of the next step."""
        return self._previous

    def prepare(self, segment: Segment, views: Views, stamp_ns: int) -> Prepared:
        """The evidence of the next set; none if its outlook is not known yet.

        Args:
            segment: makes the evidence of views and their time with an outlook.
            views: of the set.
            stamp_ns: their time.

        Raises:
            TrackerError: as `segment`.
        """
        number, outlook = self._take()
        if outlook is None:
            return Prepared(views, stamp_ns, None, {}, number)
        try:
            seen = segment(views, stamp_ns, outlook)
        except TrackerError:
            self._drop()
            raise
        return Prepared(views, stamp_ns, outlook, seen, number)

    def _take(self) -> tuple[int, Outlook | None]:
        """Number and outlook of the set that is prepared now; None if that is not known yet."""
        with self._lock:
            place = self._prepared - self._done + self._running
            self._prepared += 1
            return self._prepared, (self._previous, self._latest, None)[min(place, 2)]

    def _drop(self) -> None:
        """Note that the set whose outlook was taken last will not be tracked."""
        with self._lock:
            self._prepared = max(self._done, self._prepared - 1)

    def begin(self, prepared: Prepared | None) -> Outlook:
        """Begin a step; returns its outlook."""
        with self._lock:
            self._running = True
            # Sets that were prepared before this one will not come any more.
            number = self._prepared if prepared is None else prepared.number
            self._done = max(self._done, number)
            return self._previous

    @staticmethod
    def made(
        views: Views | Prepared, stamp_ns: int, outlook: Outlook
    ) -> tuple[Views, Mapping[str, SeenView] | None]:
        """The views of a step, and the evidence made ahead if it is valid for the step; else None.

        Args:
            views: the step's.
            stamp_ns: their time.
            outlook: the step's, from `begin`.
        """
        if not isinstance(views, Prepared):
            return views, None
        holds = views.outlook is outlook and views.stamp_ns == stamp_ns
        return views.views, views.seen if holds else None

    def end(self, latest: Outlook | None) -> None:
        """End a step with its outlook; None if it failed."""
        with self._lock:
            self._running = False
            if latest is not None:
                self._previous, self._latest = self._latest, latest
