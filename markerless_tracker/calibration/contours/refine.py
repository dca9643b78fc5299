"""Corrects a calibration from tracked frames, with its uncertainty and what is undetermined."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.calibration.contours.adjust import PRIOR_SD, ContourAdjustment
from markerless_tracker.calibration.contours.cameras import FOCAL, POSITION, ROTATION, moved
from markerless_tracker.calibration.contours.frames import SeenFrame, extent_m, independence
from markerless_tracker.calibration.contours.wrong import free_wrong_cameras, scale_of
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.cameras.check import DISAGREES_M
from markerless_tracker.tracking.limits import joint_limits

LEAST_CAMERAS = 3
"""With two cameras that disagree, either may be wrong."""
LEAST_INDEPENDENT = 2.0
"""Least effective number of independent frames: with fewer, a wrong camera cannot be distinguished
from a wrong body shape."""
UNDETERMINED = 0.9
"""A change is held if its standard deviation exceeds this fraction of its prior one."""
NAMES = ("tilt", "pan", "roll", "x", "y", "z", "focal length")
"""Names of the seven changes; axes of the camera: x to the right, y down, z forward."""
_LAST = 12
_NEAR_M = 0.08


@dataclass(frozen=True, eq=False)
class CameraRefinement:
    """The correction of one camera.

    Attributes:
        change: (7,) see `contours.cameras`; zeros if the camera is right.
        sd: (7,) standard deviations; zeros if it is right, or where it is held.
        held: names of changes that the contours do not determine.
        before_px, after_px: (u, v) of the silhouettes beside the body, at full size; NaN if the
            camera was never compared.
        displaced_m: how far the change displaces the person in the image, at the body.
        corrected: whether it is changed at all.
    """

    change: FloatArray
    sd: FloatArray
    held: tuple[str, ...]
    before_px: tuple[float, float]
    after_px: tuple[float, float]
    displaced_m: float
    corrected: bool

    def as_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "corrected": self.corrected,
            "shift_px": {
                "before": _pixels(self.before_px),
                "after": _pixels(self.after_px),
            },
            "displaced_mm": round(1000.0 * self.displaced_m, 1),
            "rotation_deg": _rounded(np.degrees(self.change[ROTATION])),
            "rotation_sd_deg": _rounded(np.degrees(self.sd[ROTATION])),
            "position_mm": _rounded(1000.0 * self.change[POSITION]),
            "position_sd_mm": _rounded(1000.0 * self.sd[POSITION]),
            "focal_percent": round(float(100.0 * np.expm1(self.change[FOCAL][0])), 3),
            "focal_sd_percent": round(float(100.0 * self.sd[FOCAL][0]), 3),
            "held": list(self.held),
        }


@dataclass(frozen=True, eq=False)
class Refinement:
    """A corrected calibration.

    Attributes:
        cameras: camera -> what became of it, in the rig's order.
        frames: number of frames used; independent: effective number of independent ones.
        extent_m: (3,) of the person's centre, along the world's axes.
        residual_m: root mean square distance of outlines and silhouettes.
        anchored: whether cameras that are right keep the world in its place; else the mean of all.
    """

    cameras: Mapping[str, CameraRefinement]
    frames: int
    independent: float
    extent_m: FloatArray
    residual_m: float
    anchored: bool

    def applied(self, rig: CameraRig) -> CameraRig:
        """The corrected rig, from the rig of images of any scale."""
        return CameraRig(
            tuple(
                moved(camera, self.cameras[camera.name].change)
                if self.cameras[camera.name].corrected
                else camera
                for camera in rig
            )
        )

    def as_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "frames": self.frames,
            "independent_frames": round(self.independent, 2),
            "extent_m": _rounded(self.extent_m),
            "residual_mm": round(1000.0 * self.residual_m, 2),
            "anchored": self.anchored,
            "cameras": {name: one.as_mapping() for name, one in self.cameras.items()},
        }


def refine_cameras(
    rig: CameraRig,
    body: BodyModel,
    config: TrackerConfig,
    frames: Sequence[SeenFrame],
    *,
    scale: float = 1.0,
) -> Refinement:
    """Correct the cameras that disagree with the others.

    Args:
        rig: the cameras as tracked with.
        body: the body as tracked last.
        config: settings of the tracker.
        frames: tracked frames, of `FrameChoice`.
        scale: factor from full-size images to those tracked.

    Raises:
        CalibrationError: too few cameras see the person, no frame was tracked, or the person hardly
            moves.
    """
    independent, extent = _checked(rig, frames)
    start = ContourAdjustment(
        rig,
        body,
        Sizes(load_description(config.body)),
        frames,
        joint_limits(body, config),
        step_px=config.edges.step_px,
    )
    adjustment, wrong = free_wrong_cameras(start, DISAGREES_M)
    if wrong:
        adjustment.run(_LAST, _NEAR_M)
        held = adjustment.free & (_deviations(adjustment) > UNDETERMINED * PRIOR_SD)
        if held.any():
            adjustment.hold(held | ~adjustment.free)
            adjustment.run(_LAST, _NEAR_M)
    changes = adjustment.changes
    deviations = _deviations(adjustment)
    after, moved_px = adjustment.shifts_px() / scale, adjustment.moved_px() / scale
    displaced = adjustment.displacements_m()
    cameras = {}
    for number, camera in enumerate(rig):
        corrected = number in wrong
        kept = [n for n, free in zip(NAMES, adjustment.free[number], strict=True) if not free]
        cameras[camera.name] = CameraRefinement(
            change=changes[number] if corrected else np.zeros_like(changes[number]),
            sd=deviations[number],
            held=tuple(kept) if corrected else (),
            before_px=_pair(after[number] + moved_px[number]),
            after_px=_pair(after[number]),
            displaced_m=float(displaced[number]) if corrected else 0.0,
            corrected=corrected,
        )
    return Refinement(
        cameras,
        len(frames),
        independent,
        extent,
        adjustment.evaluation().residual_m,
        len(wrong) < len(rig),
    )


def _checked(rig: CameraRig, frames: Sequence[SeenFrame]) -> tuple[float, FloatArray]:
    """Effective number of independent frames and the motion's extent (3,), if they suffice."""
    if not frames:
        raise CalibrationError("no frame was tracked in two views, expected a tracked person")
    seeing = {name for frame in frames for name in frame.observations} & set(rig.names)
    if len(seeing) < LEAST_CAMERAS:
        raise CalibrationError(
            f"{len(seeing)} cameras see the person: either may be wrong where two disagree, "
            f"expected {LEAST_CAMERAS} or more"
        )
    independent, extent = float(independence(frames).sum()), extent_m(frames)
    if independent < LEAST_INDEPENDENT:
        across = " x ".join(f"{value:.2f}" for value in extent)
        raise CalibrationError(
            f"the person hardly moves: {len(frames)} frames are as good as {independent:.1f} "
            f"independent ones, expected {LEAST_INDEPENDENT:g} or more; the centre of the body "
            f"moves by {across} m. Track a person that walks through the whole volume"
        )
    return independent, extent


def _deviations(adjustment: ContourAdjustment) -> FloatArray:
    """Standard deviations (c, 7) of the changes; 0 of those that are held."""
    now = adjustment.evaluation()
    free: NDArray[np.bool_] = adjustment.free.ravel()
    out = np.zeros(free.size)
    if free.any():
        prior = np.tile(1.0 / PRIOR_SD**2, len(adjustment.cameras))
        matrix = scale_of(now) * now.information + np.diag(prior)
        out[free] = np.sqrt(np.diag(np.linalg.inv(matrix[np.ix_(free, free)])))
    return out.reshape(adjustment.free.shape)


def _pixels(values: tuple[float, float]) -> list[float] | None:
    return [round(value, 2) for value in values] if np.isfinite(values).all() else None


def _pair(values: FloatArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(value), 3) for value in values]
