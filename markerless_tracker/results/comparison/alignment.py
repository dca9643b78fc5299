"""Alignment of two worlds and two clocks: a rigid transform and a time offset per recording."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.comparison.measures import rotation_onto

MOST_OFFSET_S = 5.0
"""Largest time offset that is searched."""
_LEAST_ROWS = 10
_GAP_PERIODS = 1.5
# Least distance of the markers from one line, m (root mean square over markers and rows).
_LEAST_SPREAD_M = 1e-3
# Fractions of the result's period at which the residual is compared about the coarse offset.
_FINE = np.arange(-8, 9) / 4.0
# Times that differ by less are the same, s.
_SAME_S = 1e-6
# Speeds that differ by less from their mean (m/s) show no time offset.
_LEAST_SPEED_SD = 0.02


@dataclass(frozen=True, eq=False)
class Alignment:
    """Transform from a result's world to that of a reference, and the offset of the clocks.

    Attributes:
        rotation: (3, 3) takes directions of the result's world to the reference's.
        translation_m: (3,) position of the result's origin in the reference's world, m.
        offset_s: time of the reference's clock when that of the result is 0, s.
        rms_mm: root mean square distance of the markers after the alignment.
    """

    rotation: FloatArray
    translation_m: FloatArray
    offset_s: float
    rms_mm: float

    @property
    def angle_deg(self) -> float:
        """Angle of the rotation in degrees."""
        cosine = np.clip((np.trace(self.rotation) - 1.0) / 2.0, -1.0, 1.0)
        return float(np.rad2deg(np.arccos(cosine)))

    def as_dict(self) -> dict[str, Any]:
        """The figures for JSON."""
        return {
            "rotation": self.rotation.tolist(),
            "rotation_deg": self.angle_deg,
            "translation_mm": (self.translation_m * 1000.0).tolist(),
            "time_offset_s": self.offset_s,
            "rms_mm": self.rms_mm,
        }

    def apply(
        self, result: MarkerTrack, reference: MarkerTrack, *, into_result: bool
    ) -> tuple[MarkerTrack, MarkerTrack]:
        """Both in one world, at the result's times.

        The reference is interpolated linearly between neighbouring rows.

        Args:
            result, reference: as for `align`.
            into_result: whether the reference is moved to the result's world, else the other way
                round. The world's z axis must be vertical for headings and angles of the trunk.
        """
        at = interpolated(reference, result.stamps_ns / 1e9 + self.offset_s)
        positions = result.positions_m
        if into_result:
            at = (at - self.translation_m) @ self.rotation
        else:
            positions = positions @ self.rotation.T + self.translation_m
        stamps_ns = result.stamps_ns
        return (
            MarkerTrack(result.names, stamps_ns, positions),
            MarkerTrack(reference.names, stamps_ns, at),
        )

    def rows_from(self, result_ns: int, reference: MarkerTrack) -> int:
        """Number of the reference's rows from a stamp of the result's clock on."""
        from_s = result_ns / 1e9 + self.offset_s
        return int((reference.stamps_ns / 1e9 >= from_s - _SAME_S).sum())


def align(result: MarkerTrack, reference: MarkerTrack) -> Alignment:
    """Find the rigid transform between the worlds' axes and the offset between the clocks.

    First the offset is found at which the markers' speeds, which do not depend on the frame of
    reference, agree best. It is refined by the residual of the rigid alignment (least squares over
    all common markers and rows).

    Args:
        result: a track.
        reference: the track that it is to be compared with.

    Raises:
        DatasetError: no common marker, fewer than 10 common rows, too few rows in common at every
            offset, or all positions on one line, about which the rotation is unknown.
    """
    result, reference = result.with_pelvis(), reference.with_pelvis()
    names = [name for name in reference.names if name in result.names]
    if not names:
        raise DatasetError(
            f"no common marker: the result has {', '.join(result.names)}; "
            f"the reference has {', '.join(reference.names)}"
        )
    result, reference = result.selected(names), reference.selected(names)
    if min(len(result), len(reference)) < _LEAST_ROWS:
        raise DatasetError(
            f"cannot align {min(len(result), len(reference))} rows, expected at least {_LEAST_ROWS}"
        )
    period = float(np.median(np.diff(result.stamps_ns))) / 1e9
    coarse = _coarse_offset(result, reference, period)
    offsets = coarse + _FINE * period
    residuals = np.array([_rms(result, reference, offset) for offset in offsets])
    if not np.isfinite(residuals).any():
        raise DatasetError("cannot align: the result and the reference share too few rows")
    best = int(np.nanargmin(residuals))
    offset = float(offsets[best])
    if 0 < best < len(offsets) - 1:
        before, at, after = residuals[best - 1 : best + 2] ** 2
        bend = before - 2.0 * at + after
        if np.isfinite(bend) and bend > 0.0:
            offset += 0.5 * (before - after) / bend * period * float(_FINE[1] - _FINE[0])
    common = _common_points(result, reference, offset)
    if common is None:
        raise DatasetError("cannot align: the result and the reference share too few rows")
    if min(map(_spread_m, common)) < _LEAST_SPREAD_M:
        raise DatasetError(
            f"cannot align: all positions of {', '.join(names)} lie on one line, expected markers "
            "or motion beside it"
        )
    return _rigid(*common, offset)


def interpolated(track: MarkerTrack, times_s: FloatArray) -> FloatArray:
    """Positions (k, m, 3) at times (k,), linear between neighbouring rows, NaN beside gaps."""
    own = track.stamps_ns / 1e9
    after = np.searchsorted(own, times_s).clip(1, len(own) - 1)
    before = after - 1
    span = own[after] - own[before]
    share = (times_s - own[before]) / span
    period = float(np.median(np.diff(own)))
    inside = (share >= -1e-6) & (share <= 1.0 + 1e-6) & (span <= _GAP_PERIODS * period)
    first, last = track.positions_m[before], track.positions_m[after]
    share = share.clip(0.0, 1.0)[:, None, None]
    # A row met exactly needs no neighbour.
    mixed = np.where(
        share < 1e-6, first, np.where(share > 1.0 - 1e-6, last, first + share * (last - first))
    )
    exact = (share < 1e-6) | (share > 1.0 - 1e-6)
    shown = inside[:, None, None] | (exact & _near(own, times_s))
    return np.asarray(np.where(shown, mixed, np.nan))


def _near(own: FloatArray, times_s: FloatArray) -> NDArray[np.bool_]:
    """(k, 1, 1) whether a time is that of a row, to the microsecond."""
    after = np.searchsorted(own, times_s).clip(1, len(own) - 1)
    gap = np.minimum(np.abs(own[after] - times_s), np.abs(own[after - 1] - times_s))
    return np.asarray((gap < _SAME_S)[:, None, None])


def _common_points(
    result: MarkerTrack, reference: MarkerTrack, offset_s: float
) -> tuple[FloatArray, FloatArray] | None:
    """Positions (k, 3) of the result and of the reference at the same times; None for few rows."""
    targets = interpolated(reference, result.stamps_ns / 1e9 + offset_s)
    both = np.asarray(
        np.isfinite(result.positions_m).all(axis=2) & np.isfinite(targets).all(axis=2)
    )
    if both.any(axis=1).sum() < _LEAST_ROWS:
        return None
    return result.positions_m[both], targets[both]


def _spread_m(points: FloatArray) -> float:
    """Root mean square distance of points (k, 3) from one line, along its widest normal."""
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(singular[1] / np.sqrt(len(points)))


def _rigid(points: FloatArray, wanted: FloatArray, offset_s: float) -> Alignment:
    rotation, _ = rotation_onto(points, wanted)
    translation = wanted.mean(axis=0) - rotation @ points.mean(axis=0)
    errors = np.linalg.norm(points @ rotation.T + translation - wanted, axis=1)
    return Alignment(rotation, translation, offset_s, float(np.sqrt((errors**2).mean()) * 1000.0))


def _rms(result: MarkerTrack, reference: MarkerTrack, offset_s: float) -> float:
    common = _common_points(result, reference, offset_s)
    return float("nan") if common is None else _rigid(*common, offset_s).rms_mm


def _coarse_offset(result: MarkerTrack, reference: MarkerTrack, period: float) -> float:
    """Offset at which the markers' speeds agree best: about 0 or about equal beginnings.

    An offset is possible if half of the speeds of the shorter track are compared there. 0 where too
    little moves.

    Raises:
        DatasetError: something moves, but no offset is possible.
    """
    times = result.stamps_ns / 1e9
    own = _speeds(result.positions_m, period)
    if not np.nanstd(own) > _LEAST_SPEED_SD:
        return 0.0
    first_s, last_s = reference.stamps_ns[[0, -1]] / 1e9
    whole = _speeds(interpolated(reference, np.arange(first_s, last_s, period)), period)
    least = 0.5 * min(np.isfinite(own).sum(), np.isfinite(whole).sum())
    steps = int(MOST_OFFSET_S / period)
    best, offset = -np.inf, 0.0
    # Clocks may begin anywhere: equal beginnings are a second guess.
    guesses = (0.0, float(reference.stamps_ns[0] - result.stamps_ns[0]) / 1e9)
    for about in dict.fromkeys(guesses):
        for step in sorted(range(-steps, steps + 1), key=abs):
            shift = about + step * period
            other = _speeds(interpolated(reference, times + shift), period)
            agreement = _correlation(own, other, least)
            if agreement > best + 1e-9:
                best, offset = agreement, shift
    if not np.isfinite(best):
        raise DatasetError(
            "cannot align: at no time offset is half of the result's or the reference's motion in "
            f"common, expected one within {MOST_OFFSET_S:g} s of equal clocks or equal beginnings"
        )
    return offset


def _speeds(positions_m: FloatArray, period: float) -> FloatArray:
    """(n - 1, m) speeds in m/s."""
    return np.asarray(np.linalg.norm(np.diff(positions_m, axis=0), axis=2) / period)


def _correlation(one: FloatArray, other: FloatArray, least: float) -> float:
    """Correlation over the values that both hold; -inf for fewer than `least`."""
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < max(least, _LEAST_ROWS):
        return -np.inf
    a, b = one[both] - one[both].mean(), other[both] - other[both].mean()
    size = float(np.sqrt((a**2).sum() * (b**2).sum()))
    return float((a * b).sum()) / size if size > 0.0 else -np.inf
