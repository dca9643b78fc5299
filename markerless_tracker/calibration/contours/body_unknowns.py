"""The body in a refinement of cameras: lengths and sections near those that were tracked."""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.sizes import PROPORTION_SD, Sizes
from markerless_tracker.fitness.contour import OutlineRows, length_jacobian
from markerless_tracker.fitness.shape import Sections
from markerless_tracker.geometry import FloatArray

SIZE_SD = 0.03
"""Relative standard deviation of the size of a tracked body."""
_STEP = 1e-4
"""Change of a log length in the finite differences."""
_LONGEST_STEP = 0.05
"""Largest change of a log length in one iteration."""


class BodyUnknowns:
    """Logarithms of the lengths and numbers of the sections, with priors about the tracked body.

    Args:
        body: the body that was tracked.
        sizes: makes it with other lengths.

    Attributes:
        size: number of unknowns.
        body: the body so far.
    """

    def __init__(self, body: BodyModel, sizes: Sizes) -> None:
        self._sizes = sizes
        self._mean = np.log(sizes.of(body))
        self._like = sizes.body(np.exp(self._mean), body)
        self._sections = Sections(self._like)
        lengths = self._mean.size
        common = np.full((lengths, lengths), SIZE_SD**2)
        self._precision = np.linalg.inv(common + np.diag(np.full(lengths, PROPORTION_SD**2)))
        self._lengths, self._numbers = self._mean, self._sections.prior_mean
        self.size = lengths + self._sections.size
        self.body = self._made(self._lengths)

    @property
    def strain(self) -> float:
        """-log p of the priors."""
        longer = self._lengths - self._mean
        other = (self._numbers - self._sections.prior_mean) / self._sections.prior_sd
        return 0.5 * float(longer @ self._precision @ longer + other @ other)

    def add_priors(self, hessian: FloatArray, gradient: FloatArray) -> None:
        """Add those of the priors to equations whose last unknowns these are."""
        first = gradient.size - self.size
        split = first + self._lengths.size
        hessian[first:split, first:split] += self._precision
        gradient[first:split] += self._precision @ (self._lengths - self._mean)
        rest = np.arange(split, gradient.size)
        hessian[rest, rest] += 1.0 / self._sections.prior_sd**2
        gradient[rest] += (self._numbers - self._sections.prior_mean) / self._sections.prior_sd**2

    def longer(self) -> list[BodyModel]:
        """The body with each length changed a little, for `jacobian`."""
        return [self._made(self._lengths + step) for step in _STEP * np.eye(self._lengths.size)]

    def jacobian(
        self, longer: list[BodyModel], pose: FloatArray, rows: OutlineRows, points: FloatArray
    ) -> FloatArray:
        """Derivatives (n, size) of residuals.

        Args:
            longer: of `longer`.
            pose: (p,).
            rows: the residuals.
            points: (n, 3) their places on the body, world.
        """
        by_length = length_jacobian(longer, pose, rows, points, _STEP)
        by_section = self._sections.jacobian(self.body, pose, rows)
        return np.concatenate([by_length, by_section], axis=1)

    def take(self, step: FloatArray) -> FloatArray:
        """Change the unknowns by a step (size,); returns the step after clipping to the bounds."""
        split = self._lengths.size
        lengths = np.clip(step[:split], -_LONGEST_STEP, _LONGEST_STEP)
        numbers = np.clip(self._numbers + step[split:], *self._sections.bounds)
        taken = np.concatenate([lengths, numbers - self._numbers])
        self._lengths, self._numbers = self._lengths + lengths, numbers
        self.body = self._made(self._lengths)
        return taken

    def _made(self, log_lengths: FloatArray) -> BodyModel:
        sized = self._sizes.body(np.exp(log_lengths), self._like)
        return self._sections.put(sized, self._numbers)
