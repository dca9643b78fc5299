"""A request to learn the backgrounds: collects sets of images, learns and answers."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event, Lock
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import TrackerError
from markerless_tracker.imaging import BackgroundModel, ImagingSettings, write_background_model
from markerless_tracker.imaging.background import MODEL_SUFFIX, MOVING_SHARE, LiveBackground
from markerless_tracker.records import Observation, TrackState

PATIENCE_S = 10.0
"""Longest wait for the next set before the request fails."""


class TakesBackgrounds(Protocol):
    """Receiver of the backgrounds: a `tracking.Tracker`."""

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use these backgrounds from now on."""


class Learning:
    """Collects sets of images of the empty scene; refuses if the scene is not empty.

    The scene is not empty if a person is tracked in the first or the last set, or if something
    moves between the sets. A motionless person that the tracker does not find goes undetected. One
    thread collects; any thread may wait for the answer.

    Args:
        cameras: names of all cameras.
        sets: number of sets to collect.
        settings: as in `learn_background`.
        folder: folder to write `NAME.npz` to; None = write no files.
        clock: monotonic time in s.

    Attributes:
        success, message: the answer, valid if `answered`.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        sets: int,
        settings: ImagingSettings,
        folder: Path | None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._scenes = {name: LiveBackground(name, settings) for name in cameras}
        self._sets, self._taken = sets, 0
        self._folder = folder
        self._clock = clock
        self._last_set_s = clock()
        self._answered = Event()
        self.success, self.message = False, ""

    @property
    def answered(self) -> bool:
        """Whether there is an answer."""
        return self._answered.is_set()

    @property
    def searches_person(self) -> bool:
        """Whether the tracker must search the last set for a person."""
        return self._taken in (1, self._sets)

    def take(self, images: Mapping[str, NDArray[np.uint8] | Observation]) -> None:
        """Add a set of images, by camera; refuses if something has moved since the first set."""
        self._last_set_s = self._clock()
        self._taken += 1
        for name, image in images.items():
            if isinstance(image, Observation):
                continue  # Its segmenter has the background.
            share = self._scenes[name].add(image)
            if share > MOVING_SHARE:
                self.refuse(
                    f"{name}: {share:.1%} of the image changes; the scene must be empty and static"
                )
                return

    def saw(self, state: TrackState) -> None:
        """Take the tracker's state after a set; refuses if a person is tracked."""
        if state is TrackState.TRACKING:
            self.refuse("a person is tracked; the scene must be empty")

    def finish_if_complete(self, tracker: TakesBackgrounds) -> bool:
        """After the last set: learn the backgrounds, use and write them, and answer.

        Returns:
            Whether they are used.

        Raises:
            Exception: from the tracker; the request is then not answered.
        """
        if self.answered or self._taken < self._sets:
            return False
        few = [name for name, scene in self._scenes.items() if len(scene) < self._sets]
        if few:
            count = len(self._scenes[few[0]])
            self.refuse(f"{few[0]}: {count} of {self._sets} images were received, expected all")
            return False
        models = {name: scene.learn() for name, scene in self._scenes.items()}
        tracker.take_backgrounds(models)
        self.success = True
        self.message = f"{', '.join(models)} learned from {self._sets} images each"
        if self._folder is not None:
            try:
                for name, model in models.items():
                    write_background_model(self._folder / f"{name}{MODEL_SUFFIX}", model)
                self.message += f", written to {self._folder}"
            except TrackerError as error:
                self.success = False
                self.message += f" and in use, but not saved: {error}"
        self._answered.set()
        return True

    def refuse(self, why: str) -> None:
        """Answer that nothing is learned, with a reason in one line; later reasons are ignored."""
        if not self.answered:
            self.message = f"nothing learned: {why}"
            self._answered.set()

    def refuse_if_overdue(self, activity: str) -> None:
        """Refuse if no set was received for `PATIENCE_S`.

        Args:
            activity: of the tracker, for the message.
        """
        if self._clock() - self._last_set_s > PATIENCE_S:
            self.refuse(
                f"{self._taken} of {self._sets} sets of images were received, then none for "
                f"{PATIENCE_S:g} s ({activity})"
            )

    def answer(self, response: Any) -> Any:
        """Fill in a std_srvs/Trigger response."""
        response.success, response.message = self.success, self.message
        return response


class OpenRequest:
    """Holds the open request, at most one. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._learning: Learning | None = None

    @property
    def current(self) -> Learning | None:
        """The open request; None if there is none or it has been answered."""
        with self._lock:
            if self._learning is not None and self._learning.answered:
                self._learning = None
            return self._learning

    def open(self, learning: Learning) -> None:
        """Take a request; refuses it while another is open."""
        with self._lock:
            if self._learning is not None and not self._learning.answered:
                learning.refuse("the backgrounds are being learned already")
                return
            self._learning = learning
