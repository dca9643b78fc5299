"""A pose rotated about the vertical axis, with its left and right limbs exchanged, or both."""

from functools import lru_cache

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.anatomy import posture
from markerless_tracker.body.model import MARKER_NAMES
from markerless_tracker.geometry import FloatArray

_BENT = {
    f"{side}_{name}": angle
    for side in "lr"
    for name, angle in (("elbow", 0.8), ("knee", 0.8), ("shoulder_y", 0.4), ("hip_y", 0.4))
}
"""A posture in which every joint moves a marker."""
_CHANGE_RAD = 0.2
_OTHER = {"L": "R", "R": "L"}
_MIRRORED = np.array([1.0, -1.0, 1.0])
_REVERSED = np.array([-1.0, -1.0, 1.0])
TRUNK = [MARKER_NAMES.index(name) for name in ("Pelvis", "Neck")]
"""Rows of the pelvis and the neck among the markers."""


class Mirror:
    """Exchanges the parameters of the left and right limbs of a body, with the right signs.

    The sign of a parameter is the one with which its change moves the markers of its side as the
    mirror image of what the same change of the other side's parameter does.

    Args:
        body: the body; parameters `l_NAME` and `r_NAME` belong together.
    """

    def __init__(self, body: BodyModel) -> None:
        self._exchange = _Exchange(body, posture(body, _BENT), _limb_pairs(body), _MIRRORED)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,) with the limbs exchanged; root, trunk and head stay."""
        return self._exchange.of(pose)


class OppositeHeading:
    """Reverses a person's heading, with every joint near its position.

    A trunk bent forwards becomes one bent backwards, as far as the joints allow. Both poses give
    nearly the same silhouettes.

    Args:
        body: the body; parameters `l_NAME` and `r_NAME` belong together.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        root = [body.index("pelvis_rz"), *body.root_position]
        alone = [
            (i, i)
            for i, name in enumerate(body.parameter_names)
            if not name.startswith(("l_", "r_")) and i not in root
        ]
        pairs = [*_limb_pairs(body), *alone]
        self._exchange = _Exchange(body, body.neutral, pairs, _REVERSED)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,) with its heading reversed about its trunk's middle; it may violate limits."""
        return rotated_by(self._body, self._exchange.of(pose), np.pi, about=pose)


def rotated_by(
    body: BodyModel, pose: FloatArray, angle_rad: float, *, about: FloatArray
) -> FloatArray:
    """A pose (p,) rotated about the vertical axis; it may violate joint limits.

    The middle of its trunk is moved to where the pose `about` (p,) has it.
    """
    out = pose.copy()
    out[body.index("pelvis_rz")] += angle_rad
    moved_m = markers(body, out) - markers(body, about)
    out[body.root_position] -= moved_m[TRUNK].mean(axis=0)
    return out


class _Exchange:
    """Exchanges paired parameters, with signs found from the movements of the markers.

    A parameter's sign is the one with which its change moves the markers as its partner's change
    does, with left and right markers exchanged and the movement multiplied by `factors`.

    Args:
        body: the body.
        about: (p,) pose at which the parameters are changed.
        pairs: indices of left and right parameters; for a parameter of the trunk, its index twice.
        factors: (3,) of a marker's movement forwards, to the left and upwards.
    """

    def __init__(
        self, body: BodyModel, about: FloatArray, pairs: list[tuple[int, int]], factors: FloatArray
    ) -> None:
        self._neutral = body.neutral
        both = [pair if pair[0] != pair[1] else pair[:1] for pair in pairs]
        self._to = np.array([i for pair in both for i in pair], dtype=np.int64)
        self._from = np.array([i for pair in both for i in pair[::-1]], dtype=np.int64)
        rest = markers(body, about)
        signs: list[float] = []
        for pair in both:
            expected = _exchanged(_moved(body, about, pair[0], _CHANGE_RAD) - rest, factors)
            gaps = [
                np.abs(_moved(body, about, pair[-1], sign * _CHANGE_RAD) - rest - expected).sum()
                for sign in (1.0, -1.0)
            ]
            signs += [1.0 if gaps[0] <= gaps[1] else -1.0] * len(pair)
        self._sign = np.array(signs)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,) with the paired parameters exchanged; the others stay."""
        out = pose.copy()
        change = (pose - self._neutral)[self._from]
        out[self._to] = self._neutral[self._to] + self._sign * change
        return out


@lru_cache(maxsize=4)
def mirror_of(body: BodyModel) -> Mirror:
    """The mirror of a body."""
    return Mirror(body)


@lru_cache(maxsize=4)
def opposite_heading(body: BodyModel) -> OppositeHeading:
    """The reversal of a body's heading."""
    return OppositeHeading(body)


def _limb_pairs(body: BodyModel) -> list[tuple[int, int]]:
    names = body.parameter_names
    return [
        (body.index(name), body.index("r_" + name[2:]))
        for name in names
        if name.startswith("l_") and "r_" + name[2:] in names
    ]


def _moved(body: BodyModel, pose: FloatArray, index: int, change_rad: float) -> FloatArray:
    moved = pose.copy()
    moved[index] += change_rad
    return markers(body, moved)


def _exchanged(change_m: FloatArray, factors: FloatArray) -> FloatArray:
    """Movements (15, 3) of the markers, left and right exchanged, times factors (3,)."""
    rows = [MARKER_NAMES.index(_OTHER.get(n[0], n[0]) + n[1:]) if n[1].isupper() else k
            for k, n in enumerate(MARKER_NAMES)]  # fmt: skip
    return np.asarray(change_m[rows] * factors)
