"""Evidence of a set made while the set before it is fitted, and from what its regions follow.

A region cannot follow from the pose of the set just before: that pose is not known yet. It follows
from the pose of the set before that one, with or without this pipeline, so that results are the
same bytes.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from markerless_tracker.body import BodyModel
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image, Region
from markerless_tracker.records import Observation
from markerless_tracker.tracking.motion import MotionModel


@dataclass(frozen=True, eq=False)
class Outlook:
    """What is known after a set, from which the regions of the set after the next one follow.

    Attributes:
        number: sets dealt with so far; -1 and 0 before the first.
        body: the tracked body.
        motion: a copy, which does not change.
        limits: (2, p) joint limits.
        searching: whether a person is looked for in the whole views.
    """

    number: int
    body: BodyModel
    motion: MotionModel
    limits: FloatArray
    searching: bool

    def predicted(self, stamp_ns: int) -> tuple[FloatArray, float | None]:
        """The pose (p,) expected at a time, and the margin around it, m; None for whole views."""
        margin_m = None if self.searching else self.motion.region_margin_m(stamp_ns)
        return self.motion.predict(stamp_ns, self.limits), margin_m


class SeenView(NamedTuple):
    """What one camera's segmentation gave.

    Attributes:
        observation: of a region or the whole frame, before components are chosen.
        image: what it was made of; None if it came ready-made.
        region: where the components of the person are chosen; None = all of it.
        exposure: brightness of the image relative to its background's, by channel.
    """

    observation: Observation
    image: Image | None
    region: Region | None
    exposure: tuple[float, ...] | None


@dataclass(frozen=True, eq=False)
class Prepared:
    """A set of views with evidence made ahead, for `Tracker.step`.

    Attributes:
        views: as `Tracker.prepare` got them; the images must not change until the step is done.
        stamp_ns: their time.
        outlook: what the regions follow from; None if nothing was made ahead.
        seen: by camera; empty if nothing was made ahead.
    """

    views: Mapping[str, Image | Observation]
    stamp_ns: int
    outlook: Outlook | None
    seen: Mapping[str, SeenView]


class Lookahead:
    """Which outlook the regions of a set follow from, whenever its evidence is made.

    `prepare` of the next set may run at any time beside the step before it. One set is made ahead;
    those further ahead are left to their step.

    Args:
        first, second: what is known before the first set, numbers -1 and 0.
    """

    def __init__(self, first: Outlook, second: Outlook) -> None:
        self._lock = threading.Lock()
        self.restart(first, second)

    def restart(self, first: Outlook, second: Outlook) -> None:
        """Begin anew; what was made ahead is not used."""
        with self._lock:
            self._previous, self._latest = first, second
            self._running = False
            self._ahead = 0

    @property
    def current(self) -> Outlook:
        """The outlook of the next step."""
        return self._previous

    def take(self) -> Outlook | None:
        """The outlook of a set that is prepared now; None if that is not known yet."""
        with self._lock:
            place = self._ahead + self._running
            self._ahead += 1
            return (self._previous, self._latest, None)[min(place, 2)]

    def drop(self) -> None:
        """A set whose outlook was taken will not come."""
        with self._lock:
            self._ahead = max(0, self._ahead - 1)

    def begin(self, prepared: Prepared | None) -> Outlook:
        """A step begins; returns its outlook."""
        with self._lock:
            self._running = True
            missed = prepared is None or prepared.outlook not in (None, self._previous)
            # A set that was prepared and then left out would count forever.
            self._ahead = 0 if missed else max(0, self._ahead - 1)
            return self._previous

    @staticmethod
    def made(
        views: Mapping[str, Image | Observation] | Prepared, stamp_ns: int, outlook: Outlook
    ) -> tuple[Mapping[str, Image | Observation], Mapping[str, SeenView] | None]:
        """The views of a step, and their evidence if what was made ahead holds for it; else None.

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
        """A step ends; None if it failed."""
        with self._lock:
            self._running = False
            if latest is not None:
                self._previous, self._latest = self._latest, latest
