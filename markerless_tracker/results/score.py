"""Errors of one marker track against another, in mm."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.markers.track import HIPS, MarkerTrack
from markerless_tracker.errors import DatasetError
from markerless_tracker.geometry import FloatArray

MM_PER_M = 1000.0
LIMBS = tuple(
    side + joint
    for joint in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
    for side in ("L", "R")
)
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
        reference_frames: rows of the reference.
        frame_mm: (frames,) mean over the joints that both hold in that frame.
        joints: name -> mean over the frames; NaN if never compared.
        limbs_mm: mean over frames of the mean over the 12 limb joints; NaN without any.
        bias: name -> mean offset result - reference, (forward, left, up) in the body's frame
            (`body_frames`); joints never compared in a frame that has one are absent.
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
        }


def score(result: MarkerTrack, reference: MarkerTrack) -> Score:
    """Compare two tracks, rows by time (within half a frame of the finer one), markers by name.

    A missing Pelvis is the midpoint of the hips. Rows and markers that one of the tracks lacks are
    omitted.

    Raises:
        DatasetError: no common marker, or no common frame; lists those of each.
    """
    result, reference = result.with_pelvis(), reference.with_pelvis()
    names = tuple(name for name in reference.names if name in result.names)
    if not names:
        raise DatasetError(
            f"no common marker: the result has {', '.join(result.names)}; "
            f"the reference has {', '.join(reference.names)}"
        )
    rows, reference_rows = match_rows(result, reference)
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
    joint_mm, offset_m = joint_mm[compared], offset_m[compared]
    reference_rows = reference_rows[compared]
    frame_mm = _mean(joint_mm, axis=1)
    joints = dict(zip(names, _mean(joint_mm, axis=0).tolist(), strict=True))
    limbs = _mean(joint_mm[:, [name in LIMBS for name in names]], axis=1)
    frames = body_frames(reference)[reference_rows]
    in_body_mm = np.einsum("nij,nmj->nmi", frames, offset_m) * MM_PER_M
    biases = _mean(in_body_mm.reshape(len(in_body_mm), -1), axis=0).reshape(-1, 3)
    return Score(
        mean_mm=float(frame_mm.mean()),
        max_mm=float(frame_mm.max()),
        worst_joint_mm=float(np.nanmax(joint_mm)),
        frames=len(frame_mm),
        reference_frames=len(reference),
        frame_mm=frame_mm,
        joints=joints,
        limbs_mm=float(_mean(limbs, axis=0)),
        bias={
            name: (float(bias[0]), float(bias[1]), float(bias[2]))
            for name, bias in zip(names, biases, strict=True)
            if np.isfinite(bias).all()
        },
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


def body_frames(track: MarkerTrack) -> FloatArray:
    """Rotations (n, 3, 3) from the world to the body's frame; rows are forward, left, up.

    up: from the middle of the hips to Neck (the middle of the shoulders where there is no Neck).
    left: from RHip to LHip, made orthogonal to up. forward: left x up.
    NaN where a marker is missing.
    """
    count = len(track)
    right, left = (_column(track, name, count) for name in reversed(HIPS))
    neck = _column(track, "Neck", count)
    shoulders = 0.5 * (_column(track, "LShoulder", count) + _column(track, "RShoulder", count))
    top = np.where(np.isfinite(neck), neck, shoulders)
    up = _unit(top - 0.5 * (left + right))
    across = left - right
    left_axis = _unit(across - (across * up).sum(axis=1, keepdims=True) * up)
    return np.stack([np.cross(left_axis, up), left_axis, up], axis=1)


def _column(track: MarkerTrack, name: str, count: int) -> FloatArray:
    if name not in track.names:
        return np.full((count, 3), np.nan)
    return track.positions_m[:, track.names.index(name)]


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 1e-9, length, np.nan)


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
