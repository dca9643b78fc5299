"""A described body in any size: its free lengths, and what is believed of a person's."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from markerless_tracker.body.build import build_body
from markerless_tracker.body.description import BodyDescription
from markerless_tracker.body.model import BodyModel
from markerless_tracker.body.subject import Subject, subject_from_stature
from markerless_tracker.geometry import FloatArray

USUAL_STATURE_M = 1.70
UNUSUAL = 0.06
"""How far adults' statures scatter, as a share of the usual one."""
TOLD = 0.01
"""How far a stature that somebody tells is off, as a share: shoes, rounding."""
PROPORTIONS = 0.04
"""How far a length scatters among people of one stature, as a share of it."""


@dataclass(frozen=True, eq=False)
class LengthBelief:
    """A Gaussian belief about the logarithms of k lengths.

    Attributes:
        mean: (k,).
        precision: (k, k).
    """

    mean: FloatArray
    precision: FloatArray


class Sizes:
    """A described body in any size; lengths of the left and the right side are alike.

    Args:
        description: the body.

    Attributes:
        names: the k free lengths, without their side.
    """

    def __init__(self, description: BodyDescription) -> None:
        self._description = description
        self.names = tuple(dict.fromkeys(_side_free(name) for name in description.lengths))
        fractions: dict[str, list[float]] = {name: [] for name in self.names}
        for name, entry in description.lengths.items():
            fractions[_side_free(name)].append(float(entry["stature"]))
        self._fractions = np.array([np.mean(values) for values in fractions.values()])

    def usual(self, stature_m: float | None) -> LengthBelief:
        """What is believed of a person of that stature, of any adult if it is None."""
        common = UNUSUAL if stature_m is None else TOLD
        covariance = np.diag(np.full(len(self.names), PROPORTIONS**2)) + common**2
        stature = USUAL_STATURE_M if stature_m is None else stature_m
        return LengthBelief(
            np.log(self._fractions * stature), np.asarray(np.linalg.inv(covariance))
        )

    def of_stature(self, stature_m: float) -> BodyModel:
        """The generic body of a person of that stature.

        Raises:
            BodyModelError: the stature is not between 0.5 and 2.6 m.
        """
        return build_body(self._description, subject_from_stature(self._description, stature_m))

    def of(self, body: BodyModel) -> FloatArray:
        """The free lengths (k,) of a body, m: means of both sides."""
        known: dict[str, list[float]] = {name: [] for name in self.names}
        for name, value in body.lengths_m.items():
            known[_side_free(name)].append(value)
        return np.array([np.mean(values) for values in known.values()])

    def body(self, lengths_m: FloatArray, like: BodyModel | None = None) -> BodyModel:
        """The body with free lengths (k,), with generic sections or those of another body.

        Lengths count as measured if the other body's do.

        Raises:
            BodyModelError: a length is not between 0 and 3 m.
        """
        by_name = dict(zip(self.names, map(float, lengths_m), strict=True))
        named: Mapping[str, float] = {
            name: by_name[_side_free(name)] for name in self._description.lengths
        }
        sized = build_body(self._description, Subject("fitted", named, measured=False))
        if like is None:
            return sized
        return replace(sized, cone_shape=like.cone_shape, measured=like.measured)


def _side_free(name: str) -> str:
    return name[2:] if name[:2] in ("l_", "r_") else name
