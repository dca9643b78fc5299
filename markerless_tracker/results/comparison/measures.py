"""The field's measures of a pose: MPJPE, PA-MPJPE and PCK."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.datasets.markers.track import PELVIS, MarkerTrack
from markerless_tracker.geometry import FloatArray
from markerless_tracker.results.score import MM_PER_M, match_rows

PCK_MM = 150.0
"""Distance within which a joint counts as correct (Mehta et al., 3DV 2017)."""
_LEAST_POINTS = 3


@dataclass(frozen=True)
class Measures:
    """Errors of a result over the frames and joints that both tracks hold.

    Attributes:
        mpjpe_mm: mean per-joint position error after the pelvis of each frame is moved onto that of
            the reference (Ionescu et al., PAMI 2014, protocol 1); mean over joints, the pelvis
            included, then over frames. None without a pelvis.
        pa_mpjpe_mm: the same after each frame is aligned with the reference by rotation,
            translation and scale (Procrustes analysis, protocol 2). None without a frame of three
            joints.
        pck: share of the joints within 150 mm of the reference after the pelvis is aligned (3DPCK,
            Mehta et al., 3DV 2017). None without a pelvis.
        only_result, only_reference: names of markers that the other track lacks.
    """

    mpjpe_mm: float | None
    pa_mpjpe_mm: float | None
    pck: float | None
    only_result: tuple[str, ...]
    only_reference: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The figures for JSON."""
        return {
            "mpjpe_mm": self.mpjpe_mm,
            "pa_mpjpe_mm": self.pa_mpjpe_mm,
            "pck": self.pck,
            "not_compared": {
                "result": list(self.only_result),
                "reference": list(self.only_reference),
            },
        }


def measures(result: MarkerTrack, reference: MarkerTrack, *, skip: int = 0) -> Measures:
    """Compare two tracks, rows by time, markers by name, as `score` does.

    Args:
        result: the track to assess.
        reference: the track to compare it with.
        skip: number of rows of the result to leave out at its beginning.
    """
    result, reference = result.with_pelvis().rows(slice(skip, None)), reference.with_pelvis()
    names = tuple(name for name in reference.names if name in result.names)
    rows, reference_rows = match_rows(result, reference)
    found = result.selected(names).positions_m[rows]
    truth = reference.selected(names).positions_m[reference_rows]
    both = np.asarray(np.isfinite(found).all(axis=2) & np.isfinite(truth).all(axis=2))
    mpjpe = pck = None
    if PELVIS in names:
        root = names.index(PELVIS)
        rooted = both & both[:, root : root + 1]
        moved = found - found[:, root : root + 1] + truth[:, root : root + 1]
        errors = np.linalg.norm(moved - truth, axis=2) * MM_PER_M
        mpjpe = _mean_of_frames(errors, rooted)
        pck = float((errors[rooted] <= PCK_MM).mean()) if rooted.any() else None
    fitted = np.full(both.shape, np.nan)
    for row in np.flatnonzero(both.sum(axis=1) >= _LEAST_POINTS).tolist():
        used = both[row]
        aligned = procrustes(found[row, used], truth[row, used])
        fitted[row, used] = np.linalg.norm(aligned - truth[row, used], axis=1) * MM_PER_M
    return Measures(
        mpjpe_mm=mpjpe,
        pa_mpjpe_mm=_mean_of_frames(fitted, np.isfinite(fitted)),
        pck=pck,
        only_result=tuple(name for name in result.names if name not in names),
        only_reference=tuple(name for name in reference.names if name not in names),
    )


def procrustes(points: FloatArray, targets: FloatArray) -> FloatArray:
    """Points (k, 3) after the rotation, translation and scale that bring them closest to targets.

    Umeyama, PAMI 1991: without a reflection.
    """
    rotation, scale = rotation_onto(points, targets)
    centred = points - points.mean(axis=0)
    return np.asarray(scale * centred @ rotation.T + targets.mean(axis=0))


def rotation_onto(points: FloatArray, targets: FloatArray) -> tuple[FloatArray, float]:
    """Rotation (3, 3) and scale of `procrustes`; the scale is 1 if the points coincide."""
    centred, wanted = points - points.mean(axis=0), targets - targets.mean(axis=0)
    u, stretch, vt = np.linalg.svd(wanted.T @ centred)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    spread = float((centred**2).sum())
    scale = float((stretch * signs).sum()) / spread if spread > 0.0 else 1.0
    return np.asarray((u * signs) @ vt), scale


def _mean_of_frames(errors: FloatArray, used: NDArray[np.bool_]) -> float | None:
    """Mean over frames of the mean over their used joints; None without any."""
    counts = used.sum(axis=1)
    rows = counts > 0
    if not rows.any():
        return None
    sums = np.where(used, errors, 0.0).sum(axis=1)
    return float((sums[rows] / counts[rows]).mean())
