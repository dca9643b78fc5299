"""Lengths that were not measured, fitted over the first tracked frames."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.fitness.shape import BodyFit
from markerless_tracker.geometry import FloatArray

FRAMES = 10
"""Frames that a body is fitted to; poses change over them."""
EVERY = 2
"""One of so many tracked frames is taken."""
POLISH = 5
"""Iterations after the last frame was taken; there is one with each frame before."""
TRUNCATION_M = (0.10, 0.05)
"""Outline points farther than this from the contour are outliers: first and last iteration."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted body.

    Attributes:
        body: the body.
        moved: (p,) how far poses lie from those that the former body was tracked in.
    """

    body: BodyModel
    moved: FloatArray


@dataclass(frozen=True, eq=False)
class Unmeasured:
    """A person of whom at most the stature is known.

    Attributes:
        sizes: makes bodies of any size.
        stature_m: None = unknown, too.
    """

    sizes: Sizes
    stature_m: float | None

    @property
    def sized(self) -> Callable[[float], BodyModel] | None:
        """Makes the body of a stature, m, where that is to be found, too."""
        return self.sizes.of_stature if self.stature_m is None else None


class BodyFitting:
    """Fits the body while it is tracked, a little in every frame, so that no frame takes long.

    Args:
        person: what is known.
        limits: (2, p) of the poses.
        floor_precision: as of `BodyFit`.
    """

    def __init__(
        self, person: Unmeasured, limits: FloatArray, floor_precision: float = 0.0
    ) -> None:
        self._floor_precision = floor_precision
        self._person = person
        self._limits = limits
        self._fit: BodyFit | None = None
        self._seen = self._rounds = 0
        self._last = np.zeros(limits.shape[1])

    def add(self, body: BodyModel, contours: ContourFrame, pose: FloatArray) -> Fitted | None:
        """Take a tracked frame; the fitted body once it is done.

        Args:
            body: that was tracked; the fit begins with its lengths.
            contours: the frame's evidence.
            pose: (p,) tracked.
        """
        if self._fit is None:
            sizes = self._person.sizes
            prior = sizes.prior(self._person.stature_m)
            self._fit = BodyFit(
                sizes, body, prior, self._limits, floor_precision=self._floor_precision
            )
        self._seen += 1
        if self._seen <= EVERY * FRAMES:
            if self._seen % EVERY:
                return None
            self._fit.add(contours, pose)
            self._last = pose
        share = self._rounds / (FRAMES + POLISH - 1)
        self._fit.iterate(TRUNCATION_M[0] * (TRUNCATION_M[1] / TRUNCATION_M[0]) ** share)
        self._rounds += 1
        if self._rounds < FRAMES + POLISH:
            return None
        return Fitted(self._fit.body, self._fit.poses[-1] - self._last)

    def warm_up(self, body: BodyModel, contours: ContourFrame, pose: FloatArray) -> None:
        """Compile what `add` needs; arguments as there. Forget this fit then."""
        for _ in range(EVERY):
            self.add(body, contours, pose)
