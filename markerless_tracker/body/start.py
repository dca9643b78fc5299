"""Start poses from one row of named markers or from a YAML file of named parameters."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml

from markerless_tracker.body import kinematics
from markerless_tracker.body.files import is_number, read_yaml
from markerless_tracker.body.model import MARKER_NAMES, BodyModel
from markerless_tracker.body.subject import complete_markers
from markerless_tracker.errors import BodyModelError
from markerless_tracker.geometry import FloatArray

POSE_MARKERS = ("LHip", "RHip", "Neck")
"""Markers that a start pose needs: they give position and heading."""
_NEUTRAL_WEIGHT_M_PER_RAD = 0.004
"""Weight of the distance from neutral, for angles that the markers do not determine (the axial
rotation of a straight limb): one radian costs as much as 4 mm at one marker."""
_PRIOR_WEIGHT_M = 0.0024
"""The same of one standard deviation of the prior of poses, which also decides how a stoop is
shared by hips and trunk: markers do not show how far the pelvis tilts."""


def pose_from_markers(
    body: BodyModel,
    markers_m: Mapping[str, FloatArray],
    *,
    limits: FloatArray | None = None,
    likely: bool = False,
) -> FloatArray:
    """The pose (p,) with the least squared distances from named markers (3,), world frame, m.

    Bounded least squares within the limits (2, p), by default the body's anatomical ones. Markers
    may be missing, except the hips and the neck, which give position and heading.

    Args:
        body: the body.
        markers_m: positions (3,) by name.
        limits: (2, p) instead of the body's own.
        likely: whether the body's prior of poses determines what markers do not show; otherwise all
            joints are as near to neutral as possible.

    Raises:
        BodyModelError: LHip, RHip or Neck is missing, or the three lie on one line.
    """
    # Only a start from markers needs it, and it takes long to import.
    from scipy.optimize import least_squares

    known = complete_markers(markers_m)
    for needed in POSE_MARKERS:
        if needed not in known:
            raise BodyModelError(
                f"start pose: marker {needed} is missing, expected at least LHip, RHip and Neck; "
                f"got {', '.join(sorted(known)) or 'none'}"
            )
    names = [name for name in MARKER_NAMES if name in known]
    rows = np.array([MARKER_NAMES.index(name) for name in names])
    target = np.array([known[name] for name in names])
    bounds = body.limits if limits is None else limits
    angles = body.joints
    rest, weight = body.neutral, np.full(len(angles), _NEUTRAL_WEIGHT_M_PER_RAD)
    if likely:
        rest, weight = body.prior_mean, _PRIOR_WEIGHT_M / body.prior_sd[angles]

    start = np.clip(_upright(body, known), bounds[0], bounds[1])
    # The solver needs a start strictly inside the bounds.
    low, high = bounds[0] - 1e-9, bounds[1] + 1e-9

    def residuals(pose: FloatArray) -> FloatArray:
        gap = (kinematics.markers(body, pose)[rows] - target).ravel()
        return np.concatenate([gap, weight * (pose - rest)[angles]])

    # A second fit from the middle of the ranges avoids local minima at a limit.
    bent = start.copy()
    ranged = np.isfinite(bounds).all(axis=0)
    bent[ranged] = bounds[:, ranged].mean(axis=0)
    fits = [
        least_squares(residuals, begin, bounds=(low, high), x_scale="jac", max_nfev=400)
        for begin in (start, bent)
    ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return np.clip(best.x, bounds[0], bounds[1])


def read_pose(path: Path, body: BodyModel) -> FloatArray:
    """Read a start pose (p,): a YAML mapping of parameter names to m or rad.

    Parameters that are not named are neutral; the root's six must be named.

    Raises:
        BodyModelError: the file cannot be read, names an unknown parameter, or a value is no
            number.
    """
    data = read_yaml(path, "pose")
    if not isinstance(data, dict):
        raise BodyModelError(f"{path}: expected a mapping of parameter names to m or rad")
    pose = body.neutral.copy()
    for name, value in data.items():
        if str(name) not in body.parameter_names:
            raise BodyModelError(f"{path}: body {body.name} has no parameter {name!r}")
        if not is_number(value):
            raise BodyModelError(f"{path}: parameter {name} is {value!r}, expected a finite number")
        pose[body.index(str(name))] = float(value)
    missing = [body.parameter_names[i] for i in body.root if body.parameter_names[i] not in data]
    if missing:
        raise BodyModelError(f"{path}: the root's {', '.join(missing)} must be given")
    return pose


def write_pose(path: Path, body: BodyModel, pose: FloatArray) -> None:
    """Write a pose (p,) that `read_pose` reads back exactly."""
    named = {name: float(value) for name, value in zip(body.parameter_names, pose, strict=True)}
    path.write_text(yaml.safe_dump(named, sort_keys=False), encoding="utf-8")


def _upright(body: BodyModel, known: Mapping[str, FloatArray]) -> FloatArray:
    """The neutral pose at the position of the hips, with their heading."""
    across = known["LHip"] - known["RHip"]
    trunk = known["Neck"] - known["Pelvis"]
    if np.linalg.norm(np.cross(across, trunk)) < 1e-4:
        raise BodyModelError("start pose: LHip, RHip and Neck lie on one line")
    pose = body.neutral.copy()
    left = across / np.linalg.norm(across)
    names = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
    pose[[body.index(n) for n in names]] = known["Pelvis"]
    pose[body.index("pelvis_rz")] = np.arctan2(-left[0], left[1])
    return pose
