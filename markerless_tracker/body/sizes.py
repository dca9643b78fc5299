"""Sizes of a described body: its free lengths and their prior distribution."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from markerless_tracker.body.build import build_body
from markerless_tracker.body.description import BodyDescription
from markerless_tracker.body.model import BodyModel
from markerless_tracker.body.subject import Subject, fitted_lengths, subject_from_stature
from markerless_tracker.geometry import FloatArray

MEAN_STATURE_M = 1.70
"""Mean stature of adults."""
STATURE_SD = 0.06
"""Relative standard deviation of adults' statures."""
GIVEN_STATURE_SD = 0.01
"""Relative standard deviation of a stature given by the user (shoes, rounding)."""
PROPORTION_SD = 0.04
"""Relative standard deviation of a segment length among persons of one stature."""

_LINEAR = ("node_fixed", "marker_offset", "cone_fixed", "cone_length")
_STEP_M = 0.125


@dataclass(frozen=True, eq=False)
class LengthPrior:
    """Gaussian prior of the logarithms of k lengths in m.

    Attributes:
        mean: (k,) mean.
        precision: (k, k) inverse covariance.
    """

    mean: FloatArray
    precision: FloatArray


class Sizes:
    """A described body in any size; left and right lengths are equal.

    Args:
        description: the body.

    Attributes:
        names: names of the k free lengths, without their side.
    """

    def __init__(self, description: BodyDescription) -> None:
        self._description = description
        self.names = tuple(dict.fromkeys(_side_free(name) for name in description.lengths))
        fractions: dict[str, list[float]] = {name: [] for name in self.names}
        for name, entry in description.lengths.items():
            fractions[_side_free(name)].append(float(entry["stature"]))
        self._fractions = np.array([np.mean(values) for values in fractions.values()])

    def prior(self, stature_m: float | None) -> LengthPrior:
        """Prior of the lengths of a person with that stature, of any adult if it is None."""
        common = STATURE_SD if stature_m is None else GIVEN_STATURE_SD
        covariance = np.diag(np.full(len(self.names), PROPORTION_SD**2)) + common**2
        stature = MEAN_STATURE_M if stature_m is None else stature_m
        return LengthPrior(np.log(self._fractions * stature), np.asarray(np.linalg.inv(covariance)))

    def of_stature(self, stature_m: float) -> BodyModel:
        """The generic body of a person with that stature.

        Raises:
            BodyModelError: the stature is not between 0.5 and 2.6 m.
        """
        subject = subject_from_stature(self._description, stature_m)
        share = stature_m / MEAN_STATURE_M - 1.0
        arrays = {
            name: getattr(self._generic, name) + share * slope
            for name, slope in self._with_stature.items()
        }
        lengths_m = fitted_lengths(self._description, subject)
        return replace(self._generic, **arrays, lengths_m=lengths_m)

    def of(self, body: BodyModel) -> FloatArray:
        """The free lengths (k,) of a body, m: the mean of both sides."""
        known: dict[str, list[float]] = {name: [] for name in self.names}
        for name, value in body.lengths_m.items():
            known[_side_free(name)].append(value)
        return np.array([np.mean(values) for values in known.values()])

    def body(self, lengths_m: FloatArray, like: BodyModel | None = None) -> BodyModel:
        """The body with free lengths (k,) in m.

        Sections are generic, or those of the body `like`, which then also gives `measured`.

        Raises:
            BodyModelError: a length is not between 0 and 3 m.
        """
        subject = self._subject(lengths_m)
        if like is None:
            return build_body(self._description, subject)
        base = self._base
        longer = np.asarray(lengths_m, dtype=np.float64) - self._fractions * MEAN_STATURE_M
        arrays = {
            name: getattr(base, name) + np.tensordot(longer, slopes, axes=1)
            for name, slopes in self._slopes.items()
        }
        return replace(
            base, **arrays, lengths_m=fitted_lengths(self._description, subject),
            cone_shape=like.cone_shape, measured=like.measured,
        )  # fmt: skip

    def _subject(self, lengths_m: FloatArray) -> Subject:
        by_name = dict(zip(self.names, map(float, lengths_m), strict=True))
        named = {name: by_name[_side_free(name)] for name in self._description.lengths}
        return Subject("fitted", named, measured=False)

    @cached_property
    def _generic(self) -> BodyModel:
        """The generic body of the mean stature."""
        return build_body(
            self._description, subject_from_stature(self._description, MEAN_STATURE_M)
        )

    @cached_property
    def _with_stature(self) -> Mapping[str, FloatArray]:
        """Changes of the arrays when the stature doubles; all depend on it linearly."""
        subject = subject_from_stature(self._description, 1.5 * MEAN_STATURE_M)
        taller = build_body(self._description, subject)
        return {
            name: (getattr(taller, name) - getattr(self._generic, name)) / 0.5
            for name in (*_LINEAR, "cone_shape")
        }

    @cached_property
    def _base(self) -> BodyModel:
        """A body of the mean stature."""
        return build_body(self._description, self._subject(self._fractions * MEAN_STATURE_M))

    @cached_property
    def _slopes(self) -> Mapping[str, FloatArray]:
        """Derivatives (k, ...) of the arrays that depend on the free lengths, all linearly."""
        longer = [
            build_body(self._description, self._subject(self._fractions * MEAN_STATURE_M + step))
            for step in _STEP_M * np.eye(len(self.names))
        ]
        return {
            name: np.array([getattr(other, name) - getattr(self._base, name) for other in longer])
            / _STEP_M
            for name in _LINEAR
        }


def _side_free(name: str) -> str:
    return name[2:] if name[:2] in ("l_", "r_") else name
