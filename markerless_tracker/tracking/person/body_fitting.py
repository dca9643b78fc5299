"""Lengths that were not measured, fitted over the first tracked frames."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.fitness.shape import BodyFit
from markerless_tracker.geometry import FloatArray

FRAMES = 10
"""Number of frames that a body is fitted to; the pose should change over them."""
EVERY = 2
"""Every second tracked frame is taken."""
STEPS = 3
"""Gauss-Newton steps after the last frame was taken."""
PIECES, PIECES_THEN = 1, 5
"""Pieces of a step (`BodyFit.pieces`) that are computed in each tracked frame while frames are
taken, and afterwards. The steps before the last frame only bring the poses near."""
TRUNCATION_M = (0.10, 0.05)
"""Outline points farther than this from the contour are outliers: first and last step."""


@dataclass(frozen=True, eq=False)
class FittedBody:
    """A fitted body.

    Attributes:
        body: the body.
        moved: (p,) difference of its last pose from that tracked with the former body.
    """

    body: BodyModel
    moved: FloatArray


@dataclass(frozen=True, eq=False)
class Unmeasured:
    """A person with unknown lengths, of known or unknown stature.

    Attributes:
        sizes: makes bodies of any size.
        stature_m: None = unknown.
    """

    sizes: Sizes
    stature_m: float | None

    @property
    def sized(self) -> Callable[[float], BodyModel] | None:
        """Makes the body of a stature, m; None if the stature is known."""
        return self.sizes.of_stature if self.stature_m is None else None


class BodyFitting:
    """Fits the body while it is tracked, in pieces, so that no frame takes much longer than others.

    Args:
        person: what is known of the person.
        limits: (2, p) of the poses.
        floor_precision: as in `BodyFit`.
    """

    def __init__(
        self, person: Unmeasured, limits: FloatArray, floor_precision: float = 0.0
    ) -> None:
        self._floor_precision = floor_precision
        self._person = person
        self._limits = limits
        self._fit: BodyFit | None = None
        self._pieces: Iterator[None] = iter(())
        self._seen = 0
        self._last = np.zeros(limits.shape[1])

    def add(self, body: BodyModel, contours: ContourFrame, pose: FloatArray) -> FittedBody | None:
        """Take a tracked frame; returns the fitted body when the fit is complete, else None.

        Args:
            body: the tracked body; the fit begins with its lengths.
            contours: the frame's evidence.
            pose: (p,) the tracked pose.
        """
        if self._fit is None:
            sizes = self._person.sizes
            prior = sizes.prior(self._person.stature_m)
            self._fit = BodyFit(
                sizes, body, prior, self._limits, floor_precision=self._floor_precision
            )
            self._pieces = self._fitting(self._fit)
        self._seen += 1
        taking = self._seen <= EVERY * FRAMES
        if taking and self._seen % EVERY == 0:
            self._fit.add(contours, pose)
            self._last = pose
        if self._seen < EVERY:
            return None
        try:
            for _ in range(PIECES if taking else PIECES_THEN):
                next(self._pieces)
        except StopIteration:
            return FittedBody(self._fit.body, self._fit.poses[-1] - self._last)
        return None

    def _fitting(self, fit: BodyFit) -> Iterator[None]:
        while self._seen < EVERY * FRAMES:
            yield from fit.pieces(TRUNCATION_M[0])
        for truncation_m in np.geomspace(*TRUNCATION_M, STEPS):
            yield from fit.pieces(float(truncation_m))

    def warm_up(self, body: BodyModel, contours: ContourFrame, pose: FloatArray) -> None:
        """Compile what `add` needs; same arguments. This object must not be used afterwards."""
        for _ in range(EVERY):
            self.add(body, contours, pose)
