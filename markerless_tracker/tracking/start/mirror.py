"""A pose turned about the vertical, or with the limbs exchanged as in a mirror, or both."""

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
_IN_A_MIRROR = np.array([1.0, -1.0, 1.0])
_FACING_THE_OTHER_WAY = np.array([-1.0, -1.0, 1.0])
TRUNK = [MARKER_NAMES.index(name) for name in ("Pelvis", "Neck")]
"""Rows of the pelvis and the neck among the markers."""


class Mirror:
    """Exchanges the limbs' parameters of a body, with the signs that its conventions need.

    The signs are those with which a change on one side moves the markers as the same change on the
    other side, seen in a mirror.

    Args:
        body: the body; parameters `l_NAME` and `r_NAME` belong together.
    """

    def __init__(self, body: BodyModel) -> None:
        self._exchange = _Exchange(body, posture(body, _BENT), _limb_pairs(body), _IN_A_MIRROR)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,) with the limbs exchanged; root, trunk and head stay."""
        return self._exchange.of(pose)


class TurnedRound:
    """Lets a person face the other way, with every joint near where it was.

    What was bent forwards is then bent backwards, as far as the joints allow. Both poses give
    nearly the same silhouettes.

    Args:
        body: the body; parameters `l_NAME` and `r_NAME` belong together.
    """

    def __init__(self, body: BodyModel) -> None:
        self._body = body
        root = [body.index("pelvis_rz"), *(body.index(f"pelvis_t{axis}") for axis in "xyz")]
        alone = [
            (i, i)
            for i, name in enumerate(body.parameter_names)
            if not name.startswith(("l_", "r_")) and i not in root
        ]
        pairs = [*_limb_pairs(body), *alone]
        self._exchange = _Exchange(body, body.neutral, pairs, _FACING_THE_OTHER_WAY)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,), turned about the middle of its trunk; limits may be broken."""
        return turned_by(self._body, self._exchange.of(pose), np.pi, about=pose)


def turned_by(
    body: BodyModel, pose: FloatArray, angle_rad: float, *, about: FloatArray
) -> FloatArray:
    """A pose (p,) turned about the vertical; limits may be broken.

    The middle of its trunk is where the pose `about` (p,) has it.
    """
    out = pose.copy()
    out[body.index("pelvis_rz")] += angle_rad
    moved_m = markers(body, out) - markers(body, about)
    out[[body.index(f"pelvis_t{axis}") for axis in "xyz"]] -= moved_m[TRUNK].mean(axis=0)
    return out


class _Exchange:
    """Exchanges paired parameters; a change moves the markers as their change did, seen otherwise.

    Args:
        body: the body.
        about: (p,) pose about which the changes are made.
        pairs: indices of left and right parameters; of a parameter of the trunk twice the same.
        seen: (3,) factors of a marker's movement forwards, to the left and upwards.
    """

    def __init__(
        self, body: BodyModel, about: FloatArray, pairs: list[tuple[int, int]], seen: FloatArray
    ) -> None:
        self._neutral = body.neutral
        both = [pair if pair[0] != pair[1] else pair[:1] for pair in pairs]
        self._to = np.array([i for pair in both for i in pair], dtype=np.int64)
        self._from = np.array([i for pair in both for i in pair[::-1]], dtype=np.int64)
        rest = markers(body, about)
        signs: list[float] = []
        for pair in both:
            wanted = _exchanged(_moved(body, about, pair[0], _CHANGE_RAD) - rest, seen)
            gaps = [
                np.abs(_moved(body, about, pair[-1], sign * _CHANGE_RAD) - rest - wanted).sum()
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
    """The mirror of a body; bodies of other sizes have the same."""
    return Mirror(body)


@lru_cache(maxsize=4)
def turned_round(body: BodyModel) -> TurnedRound:
    """What turns a body round."""
    return TurnedRound(body)


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


def _exchanged(change_m: FloatArray, seen: FloatArray) -> FloatArray:
    """Changes (15, 3) of the markers, those of left and right exchanged, times factors (3,)."""
    rows = [MARKER_NAMES.index(_OTHER.get(n[0], n[0]) + n[1:]) if n[1].isupper() else k
            for k, n in enumerate(MARKER_NAMES)]  # fmt: skip
    return np.asarray(change_m[rows] * seen)
