"""A pose with the limbs of both sides exchanged, as in a mirror."""

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


class Mirror:
    """Exchanges the limbs' parameters of a body, with the signs that its conventions need.

    The signs are those with which a change on one side moves the markers as the same change on the
    other side, seen in a mirror.

    Args:
        body: the body; parameters `l_NAME` and `r_NAME` belong together.
    """

    def __init__(self, body: BodyModel) -> None:
        names = body.parameter_names
        pairs = [
            (body.index(name), body.index("r_" + name[2:]))
            for name in names
            if name.startswith("l_") and "r_" + name[2:] in names
        ]
        self._neutral = body.neutral
        self._to = np.array([pair for both in pairs for pair in both], dtype=np.int64)
        self._from = np.array([pair for both in pairs for pair in both[::-1]], dtype=np.int64)
        bent = posture(body, _BENT)
        rest = markers(body, bent)
        signs = []
        for left, right in pairs:
            seen = _mirrored(_moved(body, bent, left, _CHANGE_RAD) - rest)
            gaps = [
                np.abs(_moved(body, bent, right, sign * _CHANGE_RAD) - rest - seen).sum()
                for sign in (1.0, -1.0)
            ]
            signs += [1.0 if gaps[0] <= gaps[1] else -1.0] * 2
        self._sign = np.array(signs)

    def of(self, pose: FloatArray) -> FloatArray:
        """A pose (p,) with the limbs exchanged; root, trunk and head stay."""
        out = pose.copy()
        change = (pose - self._neutral)[self._from]
        out[self._to] = self._neutral[self._to] + self._sign * change
        return out


def _moved(body: BodyModel, pose: FloatArray, index: int, change_rad: float) -> FloatArray:
    moved = pose.copy()
    moved[index] += change_rad
    return markers(body, moved)


def _mirrored(change_m: FloatArray) -> FloatArray:
    """Changes (15, 3) of the markers, seen in a mirror between left and right (y)."""
    rows = [MARKER_NAMES.index(_OTHER.get(n[0], n[0]) + n[1:]) if n[1].isupper() else k
            for k, n in enumerate(MARKER_NAMES)]  # fmt: skip
    return np.asarray(change_m[rows] * [1.0, -1.0, 1.0])
