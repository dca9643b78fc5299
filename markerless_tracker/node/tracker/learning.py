"""A request to learn the backgrounds anew, from its first set of images to its answer."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.errors import TrackerError
from markerless_tracker.imaging import BackgroundModel, ImagingSettings, write_background_model
from markerless_tracker.imaging.background import MODEL_SUFFIX, MOVING_SHARE, LiveBackground
from markerless_tracker.records import TrackState

PATIENCE_S = 10.0
"""How long the next set may take to come before the request is given up."""


class TakesBackgrounds(Protocol):
    """What gets the backgrounds: a `tracking.Tracker`."""

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Tell the person from these from now on."""


class Learning:
    """Collects sets of images of the empty scene, and refuses if it is not empty.

    The scene is not empty while the person is tracked, in the first or the last set, or while
    something moves between the sets. Somebody whom the tracker does not find and who stands quite
    still is not noticed.

    One thread collects; any thread may wait for the answer.

    Args:
        cameras: names of all cameras.
        sets: how many sets to collect.
        settings: as in `learn_background`.
        folder: where `NAME.npz` are written; None writes none.
        clock: seconds that only go forward.

    Attributes:
        success, message: the answer, once `answered`.
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
        self._heard_s = clock()
        self._answered = Event()
        self.success, self.message = False, ""

    @property
    def answered(self) -> bool:
        """Whether there is an answer."""
        return self._answered.is_set()

    @property
    def looks(self) -> bool:
        """Whether the tracker has to look for somebody in the set just taken."""
        return self._taken in (1, self._sets)

    def take(self, images: Mapping[str, NDArray[np.uint8]]) -> None:
        """Take a set of images in, by camera; refuses if something moved since the first."""
        self._heard_s = self._clock()
        self._taken += 1
        for name, image in images.items():
            share = self._scenes[name].add(image)
            if share > MOVING_SHARE:
                self.refuse(
                    f"{name}: something moves in {share:.1%} of the image; the scene must be empty "
                    "and still"
                )
                return

    def saw(self, state: TrackState) -> None:
        """What the tracker said of the set just taken; refuses if that is somebody."""
        if state is TrackState.TRACKING:
            self.refuse("somebody stands there and is tracked; the scene must be empty")

    def finish_if_complete(self, tracker: TakesBackgrounds) -> bool:
        """With the last set: learn, hand over, write, answer. Returns whether it was handed over.

        Raises:
            Exception: whatever the tracker raises; the request is then not answered.
        """
        if self.answered or self._taken < self._sets:
            return False
        few = [name for name, scene in self._scenes.items() if len(scene) < self._sets]
        if few:
            count = len(self._scenes[few[0]])
            self.refuse(f"{few[0]}: {count} of {self._sets} images came, expected all")
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
        """Answer that nothing is learned, and why, in one line; the first reason counts."""
        if not self.answered:
            self.message = f"nothing learned: {why}"
            self._answered.set()

    def refuse_if_overdue(self, activity: str) -> None:
        """Give up if no set came for long.

        Args:
            activity: what the tracker is at, for the message.
        """
        if self._clock() - self._heard_s > PATIENCE_S:
            self.refuse(
                f"{self._taken} of {self._sets} sets of images came, then none for "
                f"{PATIENCE_S:g} s ({activity})"
            )

    def answer(self, response: Any) -> Any:
        """Fill in a std_srvs/Trigger response."""
        response.success, response.message = self.success, self.message
        return response
