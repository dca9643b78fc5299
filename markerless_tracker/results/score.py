"""Errors of one marker track against another, in mm."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import LIMB_MARKERS
from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.marker_angles import angle_errors

MM_PER_M = 1000.0
SHARES_WITHIN_SD = (1, 2, 3)
# Shorter than that on the floor's plane, hips and shoulders have no direction.
_LEAST_ACROSS_M = 0.01
# Half a frame at 60 Hz, for two tracks of one row each.
LONE_ROW_TOLERANCE_NS = 8_333_333


@dataclass(frozen=True, eq=False)
class Score:
    """Errors of a result against a reference: Euclidean distances of equally named markers, mm.

    Attributes:
        mean_mm: mean over frames of the frames' means (H-MCPSO, Eq 15).
        max_mm: the largest frame mean.
        worst_joint_mm: the largest error of any one joint in any frame.
        frames: frames compared.
        reference_frames: rows of the reference; of a score that skips frames, those from the first
            frame not skipped on.
        frame_mm: (frames,) mean over the joints that both hold in that frame.
        joints: name -> mean over the frames; NaN if never compared.
        limbs_mm: mean over frames of the mean over the 12 limb joints; NaN without any.
        bias: name -> mean offset result - reference, (forward, left, up) in the heading frame
            (`heading_frames`); joints never compared in a frame that has one are absent.
        offsets_off_limbs_mm: `limbs_mm` of the errors from which each joint's `bias` is subtracted,
            over the frames with a heading; NaN without any.
        offsets_off_mm: `mean_mm` of the same errors.
        inside_sd: shares of the errors per axis that are at most 1, 2 and 3 of the reported
            standard deviations; None if the result reports none for what is compared.
        angles: name -> root mean square error, degrees, of angles that markers determine
            (`marker_angles`).
        names: (m,) the joints compared.
        stamps_ns: (frames,) the reference's stamps.
        joint_mm: (frames, m), NaN where either is missing.
    """

    mean_mm: float
    max_mm: float
    worst_joint_mm: float
    frames: int
    reference_frames: int
    frame_mm: FloatArray
    joints: Mapping[str, float]
    limbs_mm: float
    bias: Mapping[str, tuple[float, float, float]]
    offsets_off_limbs_mm: float
    offsets_off_mm: float
    inside_sd: tuple[float, float, float] | None
    angles: Mapping[str, float]
    names: tuple[str, ...]
    stamps_ns: NDArray[np.int64] = field(repr=False)
    joint_mm: FloatArray = field(repr=False)

    def as_dict(self) -> dict[str, Any]:
        """The figures as plain numbers, lists and dicts for JSON; NaN becomes None."""
        return {
            "mean_mm": self.mean_mm,
            "max_mm": self.max_mm,
            "worst_joint_mm": self.worst_joint_mm,
            "frames": self.frames,
            "reference_frames": self.reference_frames,
            "frame_mm": self.frame_mm.tolist(),
            "joints": {name: _or_none(value) for name, value in self.joints.items()},
            "limbs_mm": _or_none(self.limbs_mm),
            "bias": {name: list(offset) for name, offset in self.bias.items()},
            "offsets_off_mm": {
                "limbs": _or_none(self.offsets_off_limbs_mm),
                "all": _or_none(self.offsets_off_mm),
            },
            "inside_sd": None if self.inside_sd is None else list(self.inside_sd),
            "angles": dict(self.angles),
        }


def score(
    result: MarkerTrack,
    reference: MarkerTrack,
    *,
    markers_sd_mm: FloatArray | None = None,
    skip: int = 0,
    reference_frames: int | None = None,
) -> Score:
    """Compare two tracks, rows by time (within half a frame of the finer one), markers by name.

    A missing Pelvis is the midpoint of the hips. Rows and markers that one of the tracks lacks are
    omitted.

    Args:
        result: the track to assess.
        reference: the track to compare it with.
        markers_sd_mm: (n, m, 3) standard deviations of the result's rows and markers along x, y, z
            of the world, mm; NaN = unknown.
        skip: number of rows of the result to leave out at its beginning, blank ones included; the
            reference's rows before the first one that is left are left out, too.
        reference_frames: `Score.reference_frames` of a reference that was interpolated at the
            result's times; None counts its rows.

    Raises:
        DatasetError: no common marker, or no common frame; lists those of each.
    """
    if not 0 <= skip < max(len(result), 1):
        raise DatasetError(
            f"cannot skip {skip} frames, expected a number from 0 to {max(len(result) - 1, 0)}: "
            f"the result has {len(result)} frames"
        )
    sd_mm = _with_pelvis(result, markers_sd_mm)[skip:]
    result, reference = result.with_pelvis().rows(slice(skip, None)), reference.with_pelvis()
    names = tuple(name for name in reference.names if name in result.names)
    if not names:
        raise DatasetError(
            f"no common marker: the result has {', '.join(result.names)}; "
            f"the reference has {', '.join(reference.names)}"
        )
    rows, reference_rows = match_rows(result, reference)
    angles = angle_errors(result.rows(rows), reference.rows(reference_rows))
    offset_m = (
        result.selected(names).positions_m[rows]
        - reference.selected(names).positions_m[reference_rows]
    )
    joint_mm = np.linalg.norm(offset_m, axis=2) * MM_PER_M
    compared = np.isfinite(joint_mm).any(axis=1)
    if not compared.any():
        raise DatasetError(
            f"no common frame: the result covers {_range(result)}, the reference "
            f"{_range(reference)}"
        )
    if reference_frames is None:
        reference_frames = len(reference) - (int(reference_rows[0]) if skip else 0)
    sd_mm = sd_mm[rows][:, [result.names.index(name) for name in names]][compared]
    joint_mm, offset_m = joint_mm[compared], offset_m[compared]
    reference_rows = reference_rows[compared]
    frame_mm = _mean(joint_mm, axis=1)
    joints = dict(zip(names, _mean(joint_mm, axis=0).tolist(), strict=True))
    limbs = np.array([name in LIMB_MARKERS for name in names])
    headings = heading_frames(reference)[reference_rows]
    in_heading_mm = np.einsum("nij,nmj->nmi", headings, offset_m) * MM_PER_M
    biases = _mean(in_heading_mm, axis=0)
    off_mm = np.linalg.norm(in_heading_mm - biases, axis=2)
    return Score(
        mean_mm=float(frame_mm.mean()),
        max_mm=float(frame_mm.max()),
        worst_joint_mm=float(np.nanmax(joint_mm)),
        frames=len(frame_mm),
        reference_frames=reference_frames,
        frame_mm=frame_mm,
        joints=joints,
        limbs_mm=_mean_of_frames(joint_mm[:, limbs]),
        bias={
            name: (float(bias[0]), float(bias[1]), float(bias[2]))
            for name, bias in zip(names, biases, strict=True)
            if np.isfinite(bias).all()
        },
        offsets_off_limbs_mm=_mean_of_frames(off_mm[:, limbs]),
        offsets_off_mm=_mean_of_frames(off_mm),
        inside_sd=_inside_sd(offset_m * MM_PER_M, sd_mm),
        angles=angles,
        names=names,
        stamps_ns=reference.stamps_ns[reference_rows],
        joint_mm=joint_mm,
    )


def match_rows(
    result: MarkerTrack, reference: MarkerTrack
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (k,) of the result and of the reference that show the same moment.

    Each row of the result takes the nearest of the reference within half a frame of the finer of
    the two, and no row of the reference is taken twice (the nearer wins, then the earlier).
    """
    nothing = np.empty(0, dtype=np.int64)
    if not len(result) or not len(reference):
        return nothing, nothing
    tolerance = min(_half_frame_ns(result), _half_frame_ns(reference))
    if len(result) == 1 and len(reference) == 1:
        tolerance = LONE_ROW_TOLERANCE_NS
    after = np.searchsorted(reference.stamps_ns, result.stamps_ns).clip(
        1, max(len(reference) - 1, 1)
    )
    before = after - 1
    after = after.clip(max=len(reference) - 1)
    gaps = np.abs(reference.stamps_ns[np.stack([before, after])] - result.stamps_ns)
    nearest = np.where(gaps[1] < gaps[0], after, before)
    gap = gaps.min(axis=0)
    best: dict[int, int] = {}
    for row in np.flatnonzero(gap <= tolerance).tolist():
        holder = best.get(int(nearest[row]))
        if holder is None or gap[row] < gap[holder]:
            best[int(nearest[row])] = row
    reference_rows = np.array(sorted(best), dtype=np.int64)
    return np.array([best[row] for row in reference_rows.tolist()], dtype=np.int64), reference_rows


def heading_frames(track: MarkerTrack) -> FloatArray:
    """Rotations (n, 3, 3) from the world to the heading frame; rows are forward, left, up.

    up: the world's vertical (z). left: from the right to the left side, the sum over hips and
    shoulders (one pair where the other is missing), projected on the floor's plane.
    forward: left x up. NaN where both pairs are missing or their sum is vertical.
    """
    count = len(track)
    pairs = np.stack(
        [
            _column(track, f"L{joint}", count) - _column(track, f"R{joint}", count)
            for joint in ("Hip", "Shoulder")
        ]
    )
    across = np.where(np.isfinite(pairs), pairs, 0.0).sum(axis=0)[:, :2]
    length = np.linalg.norm(across, axis=1)
    x, y = (across / np.where(length > _LEAST_ACROSS_M, length, np.nan)[:, None]).T
    none, one = np.where(np.isfinite(x), np.array([[0.0], [1.0]]), np.nan)
    forward, left, up = (y, -x, none), (x, y, none), (none, none, one)
    return np.stack([np.stack(axis, axis=1) for axis in (forward, left, up)], axis=1)


def _column(track: MarkerTrack, name: str, count: int) -> FloatArray:
    if name not in track.names:
        return np.full((count, 3), np.nan)
    return track.positions_m[:, track.names.index(name)]


def _with_pelvis(result: MarkerTrack, sd_mm: FloatArray | None) -> FloatArray:
    """The deviations for the markers of `result.with_pelvis()`: that of its midpoint is unknown."""
    expected = (len(result), len(result.names), 3)
    if sd_mm is None:
        sd_mm = np.full(expected, np.nan)
    if sd_mm.shape != expected:
        raise DatasetError(f"markers_sd_mm has shape {sd_mm.shape}, expected {expected}")
    added = len(result.with_pelvis().names) - len(result.names)
    return np.concatenate([sd_mm, np.full((len(result), added, 3), np.nan)], axis=1)


def _inside_sd(errors_mm: FloatArray, sd_mm: FloatArray) -> tuple[float, float, float] | None:
    known = np.isfinite(errors_mm) & np.isfinite(sd_mm)
    if not known.any():
        return None
    errors, sd = np.abs(errors_mm[known]), sd_mm[known]
    one, two, three = (float((errors <= factor * sd).mean()) for factor in SHARES_WITHIN_SD)
    return one, two, three


def _mean_of_frames(errors_mm: FloatArray) -> float:
    """Mean over frames of the mean over joints; NaN where there is none."""
    return float(_mean(_mean(errors_mm, axis=1), axis=0))


def _mean(values: FloatArray, *, axis: int) -> FloatArray:
    """Mean over the finite values, NaN where there is none."""
    finite = np.isfinite(values)
    count = finite.sum(axis=axis)
    total = np.where(finite, values, 0.0).sum(axis=axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan), dtype=np.float64)


def _half_frame_ns(track: MarkerTrack) -> float:
    return float(np.median(np.diff(track.stamps_ns))) / 2.0 if len(track) > 1 else np.inf


def _range(track: MarkerTrack) -> str:
    stamps = track.stamps_ns[track.tracked] / 1e9
    if not stamps.size:
        return "no tracked frame"
    return f"{stamps[0]:.3f} to {stamps[-1]:.3f} s ({stamps.size} frames)"


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None
