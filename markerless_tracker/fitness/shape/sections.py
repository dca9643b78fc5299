"""Free parameters of a body's sections: radii and offsets, equal on the left and on the right.

The length of the hands may be one more. No marker measures it, and with hands that are too short
the arms are too straight.

A bent wrist puts the hand beside the line of the forearm, in a different direction on each side.
This is posture, so the offsets of hands without a joint of their own are independent. Otherwise the
forearm would follow the hand, and the elbow would be bent wrongly.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour import OutlineRows
from markerless_tracker.geometry import FloatArray

CLOTHED = 1.15
"""Mean radius of clothed people, relative to the generic one, of the parts `CLOTHED_PARTS` (prior).
The generic body is slim: while a person is searched for, a wide one makes wrong poses cost less."""
CLOTHED_PARTS = ("pelvis", "belly", "chest", "face", "crown", "upper_arm", "thigh")
"""Parts that hair and clothes make wider."""
RADIUS_SD_RATIO = 0.30
"""Standard deviation of radii among clothed people, relative to the mean ones (prior)."""
OFFSET_SD_M = 0.015
"""Standard deviation of offsets among people (prior)."""
RADIUS_RANGE = (0.6, 2.0)
"""Radii stay within this multiple of the generic ones (bounds)."""
OFFSET_RANGE_M = 0.06
"""Offsets stay within this distance of the generic ones (bounds)."""
HAND_SD_RATIO = 0.10
"""Standard deviation of hands' lengths, relative to the generic one (prior). Fingers are bent, more
or less."""
HAND_RANGE = (0.7, 1.3)
"""Hands' lengths stay within this multiple of the generic one (bounds)."""
_HANDS = ("hand", "l_hand", "r_hand")


class Sections:
    """The k free parameters of a body's sections.

    Limbs of both sides share their parameters, with lateral offsets mirrored, except the offsets of
    hands without a joint of their own. Trunk and head are symmetric.

    Args:
        generic: the generic body.
        limb_offset_sd_ratio: standard deviation of the limbs' offsets among people, relative to the
            generic radius; None: `OFFSET_SD_M`, as for trunk, head, and hands without a joint of
            their own.
        hands: whether the length of hands is a parameter, too.

    Attributes:
        prior_mean: (k,) mean of the prior.
        prior_sd: (k,) standard deviation of the prior.
        bounds: (2, k).
    """

    def __init__(
        self,
        generic: BodyModel,
        limb_offset_sd_ratio: float | None = None,
        *,
        hands: bool = False,
    ) -> None:
        self._index, self._sign, self._size = _tie(generic)
        # The hands' length is the last parameter.
        self._hands = np.array([name in _HANDS for name in generic.cone_names]) & hands
        self._size += int(self._hands.any())
        numbers = self.of(generic)
        self.prior_mean = self._clothed(generic) * numbers
        radius = np.zeros(self._size, dtype=np.bool_)
        radius[self._index[:, :, :2].ravel()] = True
        self.prior_sd = np.where(radius, RADIUS_SD_RATIO * self.prior_mean, OFFSET_SD_M)
        if limb_offset_sd_ratio is not None:
            for c in _limbs(generic):
                radii = generic.cone_shape[c, :, :2].mean(axis=1, keepdims=True)
                self.prior_sd[self._index[c, :, 2:]] = limb_offset_sd_ratio * radii
        self.bounds = np.where(
            radius,
            np.outer(RADIUS_RANGE, numbers),
            numbers + np.array([[-OFFSET_RANGE_M], [OFFSET_RANGE_M]]),
        )
        if self._hands.any():
            self.prior_sd[-1] = HAND_SD_RATIO * numbers[-1]
            self.bounds[:, -1] = numbers[-1] * np.array(HAND_RANGE)

    def _clothed(self, generic: BodyModel) -> FloatArray:
        """What the mean of the prior is relative to the generic parameters, (k,)."""
        factors = np.ones(self._size)
        for c, name in enumerate(generic.cone_names):
            if name.endswith(CLOTHED_PARTS):
                factors[self._index[c, :, :2]] = CLOTHED
        return factors

    @property
    def size(self) -> int:
        """k."""
        return self._size

    def of(self, body: BodyModel) -> FloatArray:
        """The parameters (k,) of a body; entries that share a parameter are averaged."""
        used = self._index >= 0
        lengths_m = body.cone_length[self._hands]
        index = np.append(self._index[used], np.full(lengths_m.size, self._size - 1))
        values = np.append((self._sign * body.cone_shape)[used], lengths_m)
        total = np.bincount(index, values, self._size)
        return np.asarray(total / np.bincount(index, minlength=self._size))

    def put(self, body: BodyModel, numbers: FloatArray) -> BodyModel:
        """The body with these parameters (k,); `lengths_m` follows the hands."""
        shape = body.cone_shape.copy()
        used = self._index >= 0
        shape[used] = self._sign[used] * numbers[self._index[used]]
        sectioned = replace(body, cone_shape=shape)
        if not self._hands.any():
            return sectioned
        return _with_hands(sectioned, self._hands, float(numbers[-1]))

    def jacobian(self, body: BodyModel, pose: FloatArray, rows: OutlineRows) -> FloatArray:
        """Derivatives (n, k) of residuals by the parameters, for a body at a pose (p,)."""
        out = np.zeros((len(rows.cone), self._size))
        _fill_jacobian(
            cone_transforms(body, pose), rows.cone, rows.place, rows.gradient, self._index,
            self._sign, self._hands, out,
        )  # fmt: skip
        return out


@kernel
def _fill_jacobian(placed, cone, place, gradient, index, sign, hand, out):  # type: ignore[no-untyped-def]
    """Fill out (n, k), zeros, with the derivatives of n residuals by k parameters.

    Args:
        placed: (c, 3, 4) the cones' transforms.
        cone, place, gradient: of `OutlineRows`.
        index, sign: (c, 2, 4) parameter of each entry of the sections, or -1, and its sign.
        hand: (c,) whether a cone's length is the last parameter.
    """
    for n in range(cone.size):
        c = cone[n]
        x = y = 0.0
        for i in range(3):
            x += gradient[n, i] * placed[c, i, 0]
            y += gradient[n, i] * placed[c, i, 1]
        for end in range(2):
            share = place[n, 4] if end == 1 else 1.0 - place[n, 4]
            for entry in range(4):
                k = index[c, end, entry]
                if k < 0:
                    continue
                along = share * (y if entry % 2 else x)
                if entry < 2:
                    # Radii count by the cosine and the sine of the place's angle.
                    along *= place[n, 2 * end + entry]
                out[n, k] += sign[c, end, entry] * along
        if hand[c]:
            for i in range(3):
                out[n, -1] += place[n, 4] * gradient[n, i] * placed[c, i, 2]


def _with_hands(body: BodyModel, hands: NDArray[np.bool_], length_m: float) -> BodyModel:
    """The body with cones of hands (c,) of this length; its named lengths follow."""
    lengths = body.cone_length.copy()
    ratio = length_m / float(lengths[hands].mean())
    lengths[hands] = length_m
    named = {n: v * ratio if n in _HANDS else v for n, v in body.lengths_m.items()}
    return replace(body, cone_length=lengths, lengths_m=named)


def _limbs(body: BodyModel) -> list[int]:
    """The cones of limbs, without the hands that have no joint of their own."""
    return [
        c
        for c, name in enumerate(body.cone_names)
        if name[:2] in ("l_", "r_") and not _is_rigid_hand(body, name)
    ]


def _tie(body: BodyModel) -> tuple[NDArray[np.int64], FloatArray, int]:
    """Parameter of each entry (c, 2, 4) of `cone_shape` (-1: none), its sign, and k."""
    index = np.full((len(body.cone_names), 2, 4), -1, dtype=np.int64)
    sign = np.ones(index.shape)
    known: dict[tuple[str, int, int], int] = {}
    for c, name in enumerate(body.cone_names):
        paired = name[:2] in ("l_", "r_")
        hand = _is_rigid_hand(body, name)
        for end in range(2):
            for entry in range(4):
                if entry == 3:
                    # Lateral offsets: none for trunk and head, mirrored for the limbs.
                    if not paired:
                        continue
                    sign[c, end, entry] = 1.0 if name[0] == "l" else -1.0
                alike = paired and not (hand and entry >= 2)
                key = (name[2:] if alike else name, end, entry)
                index[c, end, entry] = known.setdefault(key, len(known))
    return index, sign, len(known)


def _is_rigid_hand(body: BodyModel, cone: str) -> bool:
    """Whether a cone is that of a hand that is fixed to its forearm."""
    side, _, part = cone.partition("_")
    return part == "hand" and f"{side}_wrist" not in body.frames
