"""Joint angles computed from markers only, for a result and its reference.

Definitions as of the reported angles (docs/joint-angles.md), with segments from markers: the
pelvis' z axis is the line of the hips, its y axis the line from Pelvis to Neck made perpendicular.
Markers do not show the tilt of the pelvis against the trunk, nor any rotation of a straight limb.
"""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.datasets.markers.track import MarkerTrack
from markerless_tracker.geometry import FloatArray

_LEAST_M = 1e-6


def marker_angles(track: MarkerTrack) -> dict[str, FloatArray]:
    """Angles (n,) in degrees by name; NaN in rows where a marker is missing.

    `knee_angle_*`, `elbow_flex_*`: between both segments. `hip_flexion_*`, `hip_adduction_*`: the
    thigh's direction in the pelvis' axes. `arm_elevation_*`: between upper arm and the trunk's
    downward line. `trunk_tilt` (backward), `trunk_list` (to the right): of the trunk's line against
    the vertical, about the horizontal line of the hips and the one in front. `lumbar_rotation` (to
    the left): of the shoulders' line against the hips', about the trunk's line.
    """
    track = track.with_pelvis()
    at = dict(zip(track.names, np.moveaxis(track.positions_m, 1, 0), strict=True))
    angles: dict[str, FloatArray] = {}
    needed = {"LHip", "RHip", "Neck", "Pelvis"}
    trunk = at["Neck"] - at["Pelvis"] if needed <= set(at) else None
    for side in "LR":
        low, out = side.lower(), 1.0 if side == "R" else -1.0
        for name, joints in (
            ("knee_angle", ("Hip", "Knee", "Ankle")),
            ("elbow_flex", ("Shoulder", "Elbow", "Wrist")),
        ):
            if all(side + joint in at for joint in joints):
                upper, middle, lower = (at[side + joint] for joint in joints)
                angles[f"{name}_{low}"] = _between(middle - upper, lower - middle)
        if trunk is None:
            continue
        if {f"{side}Shoulder", f"{side}Elbow"} <= set(at):
            arm = at[f"{side}Elbow"] - at[f"{side}Shoulder"]
            angles[f"arm_elevation_{low}"] = _between(arm, -trunk)
        if f"{side}Knee" in at:
            up = _unit(at[f"{side}Hip"] - at[f"{side}Knee"])
            x, y, z = ((up * axis).sum(axis=1) for axis in _axes(at["RHip"] - at["LHip"], trunk))
            angles[f"hip_flexion_{low}"] = np.rad2deg(np.arctan2(-x, y))
            angles[f"hip_adduction_{low}"] = out * np.rad2deg(np.arcsin(np.clip(z, -1.0, 1.0)))
    if trunk is not None:
        angles |= _trunk(at, trunk)
    return angles


def angle_errors(result: MarkerTrack, reference: MarkerTrack) -> dict[str, float]:
    """Root mean square difference in degrees by name, of tracks whose rows are of the same times.

    Angles that one of the two does not give in any row are absent.
    """
    of_result, errors = marker_angles(result), {}
    for name, expected in marker_angles(reference).items():
        if name in of_result:
            off = (of_result[name] - expected + 180.0) % 360.0 - 180.0
            off = off[np.isfinite(off)]
            if off.size:
                errors[name] = float(np.sqrt((off**2).mean()))
    return errors


def _trunk(at: Mapping[str, FloatArray], trunk: FloatArray) -> dict[str, FloatArray]:
    hips = at["RHip"] - at["LHip"]
    level = hips * [1.0, 1.0, 0.0]
    ahead, _, right = _axes(level, np.broadcast_to([0.0, 0.0, 1.0], hips.shape))
    up = _unit(trunk)
    forward, sideways = (up * ahead).sum(axis=1), (up * right).sum(axis=1)
    angles = {
        "trunk_tilt": np.rad2deg(np.arctan2(-forward, up[:, 2])),
        "trunk_list": np.rad2deg(np.arcsin(np.clip(sideways, -1.0, 1.0))),
    }
    if {"LShoulder", "RShoulder"} <= set(at):
        x, _, z = _axes(hips, trunk)
        across = at["RShoulder"] - at["LShoulder"]
        angles["lumbar_rotation"] = np.rad2deg(
            np.arctan2((across * x).sum(axis=1), (across * z).sum(axis=1))
        )
    return angles


def _axes(right: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axes x forward, y up, z right (n, 3) each: z along the right, y as near to up as can be."""
    z = _unit(right)
    y = _unit(up - z * (up * z).sum(axis=1)[:, None])
    return np.cross(y, z), y, z


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1)
    return np.asarray(vectors / np.where(length > _LEAST_M, length, np.nan)[:, None])


def _between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Angles (n,) between vectors (n, 3), degrees."""
    cosine = (_unit(one) * _unit(other)).sum(axis=1)
    return np.asarray(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))
