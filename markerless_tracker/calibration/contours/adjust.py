"""Least squares of contours: changes of the cameras, one body and the pose of every frame.

Poses are eliminated first (Schur complement), as in the fit of a body alone (`fitness.shape`).
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.calibration.contours.body_unknowns import BodyUnknowns
from markerless_tracker.calibration.contours.cameras import (
    CHANGES,
    change_between,
    change_jacobian,
    moved,
    put,
    shift_jacobian,
)
from markerless_tracker.calibration.contours.frames import SeenFrame, contours_of, independence
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.model import project_camera
from markerless_tracker.fitness.contour import (
    ContourFrame,
    OutlineRows,
    add_pose_prior,
    eliminated,
    normal_equations,
    outline_rows,
    pose_jacobian,
    solved,
    surface,
)
from markerless_tracker.fitness.shape import CORRELATION_M
from markerless_tracker.fitness.shape.body_fit import ALONG
from markerless_tracker.fitness.shape.section_fit import RESIDUAL_SIGMA_M
from markerless_tracker.geometry import FloatArray

PRIOR_SD = np.array([*np.deg2rad([2.0, 2.0, 2.0]), 0.03, 0.03, 0.03, 0.01])
"""Standard deviation (7,) of the change of a camera that is wrong: a camera that was touched turns
more than it moves. What the contours do not determine stays near its value."""
FIRST_TRUNCATION_M = 0.2
"""Residuals beyond it are outliers in the first iteration."""
LAST_TRUNCATION_M = 0.05
"""The same in the last iterations."""
_SCALE = 1.0 / (CORRELATION_M * RESIDUAL_SIGMA_M**2 * ALONG)
_DAMPING = 1e-6
_HELD = 1e12


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The equations of the cameras' changes at a state; body and poses are eliminated.

    Attributes:
        cost: -log p of all contours and priors.
        information: (7 c, 7 c) of the contours and the priors of body and poses, without the
            cameras' priors.
        residual_m: root mean square residual, by represented length of outline.
    """

    cost: float
    information: FloatArray
    residual_m: float


@dataclass(eq=False)
class _Frame:
    contours: ContourFrame
    pose: FloatArray
    weight: float


class _Sums:
    """Equations of cameras and body, summed over frames."""

    def __init__(self, size: int) -> None:
        self.hessian, self.gradient = np.zeros((size, size)), np.zeros(size)
        self.parts: list[FloatArray] = []
        self.cost = self.squares = self.weight = 0.0


class ContourAdjustment:
    """Cameras, body and poses that fit the contours of all frames together.

    Args:
        rig: the cameras to begin with.
        body: the body that was tracked.
        sizes: makes the body of other lengths.
        frames: the frames.
        limits: (2, p) of the poses.
        step_px: see `ContourFrame`.

    Attributes:
        cameras: the cameras so far, in the rig's order.
        free: (c, 7) changes that are not held.
    """

    def __init__(
        self,
        rig: CameraRig,
        body: BodyModel,
        sizes: Sizes,
        frames: Sequence[SeenFrame],
        limits: FloatArray,
        *,
        step_px: float,
    ) -> None:
        self._first = rig.cameras
        self._limits = limits
        self._body = BodyUnknowns(body, sizes)
        self.cameras = list(rig.cameras)
        self.free = np.zeros((len(rig), CHANGES), dtype=np.bool_)
        self._frames = []
        for frame, weight in zip(frames, independence(frames), strict=True):
            contours = contours_of(
                body, rig.cameras, frame.observations, frame.markers_m,
                step_px=step_px, radius_m=FIRST_TRUNCATION_M,
            )  # fmt: skip
            self._frames.append(_Frame(contours, np.array(frame.pose), float(weight)))

    def copy(self) -> "ContourAdjustment":
        """The same state, to go on from independently; evidence is shared."""
        other = copy.copy(self)
        other.cameras, other.free = list(self.cameras), self.free.copy()
        other._body = copy.copy(self._body)
        other._frames = [replace(frame, pose=frame.pose.copy()) for frame in self._frames]
        return other

    @property
    def changes(self) -> FloatArray:
        """(c, 7) from the first cameras to those so far."""
        return np.array(
            [change_between(a, b) for a, b in zip(self._first, self.cameras, strict=True)]
        )

    @property
    def body(self) -> BodyModel:
        """The body so far."""
        return self._body.body

    def hold(self, held: NDArray[np.bool_]) -> None:
        """Hold changes (c, 7) at zero from now on, all others are free."""
        self.free = ~held
        changes = np.where(held, 0.0, self.changes)
        self.cameras = [moved(c, one) for c, one in zip(self._first, changes, strict=True)]

    def run(self, iterations: int, first_m: float = FIRST_TRUNCATION_M) -> None:
        """Damped Gauss-Newton steps; the truncation shrinks to its last value in the last third.

        Args:
            iterations: number of steps.
            first_m: residuals beyond this distance are outliers in the first.
        """
        shrinking = max(1, iterations - iterations // 3 - 1)
        for i in range(iterations):
            share = min(i / shrinking, 1.0)
            self._iterate(first_m * (LAST_TRUNCATION_M / first_m) ** share)

    def evaluation(self) -> Evaluation:
        """The equations at the state so far."""
        sums = self._summed(LAST_TRUNCATION_M)
        count = CHANGES * len(self.cameras)
        cross = sums.hessian[:count, count:]
        rest = np.linalg.solve(sums.hessian[count:, count:], cross.T)
        strain = float(np.sum((self.changes / PRIOR_SD) ** 2))
        return Evaluation(
            sums.cost + self._body.strain + 0.5 * strain,
            sums.hessian[:count, :count] - cross @ rest,
            float(np.sqrt(sums.squares / sums.weight)),
        )

    def shifts_px(self) -> FloatArray:
        """How far (c, 2) px the silhouettes of each camera lie beside the body; NaN if unknown."""
        count = len(self.cameras)
        normal, gradient = np.zeros((count, 2, 2)), np.zeros((count, 2))
        for frame in self._frames:
            rows = self._collect(frame, LAST_TRUNCATION_M)
            points = surface(self.body, frame.pose, rows)
            for number, part in self._parts(frame):
                along = shift_jacobian(self.cameras[number], points[part], rows.gradient[part])
                weighted = along * (frame.weight * rows.weight[part])[:, None]
                normal[number] += weighted.T @ along
                gradient[number] += weighted.T @ rows.value[part]
        out = np.full((count, 2), np.nan)
        for number in range(count):
            if np.linalg.matrix_rank(normal[number]) == 2:
                out[number] = -np.linalg.solve(normal[number], gradient[number])
        return out

    def moved_px(self) -> FloatArray:
        """Mean shift (c, 2) px of the person's image by the changes."""
        return np.array([pixels.mean(axis=0) for pixels, _ in self._displaced()])

    def displacements_m(self) -> FloatArray:
        """Root mean square displacement (c,) of the person in the image, in m at the body."""
        return np.array(
            [np.sqrt(((pixels * metres[:, None]) ** 2).sum(axis=1).mean())
             for pixels, metres in self._displaced()]
        )  # fmt: skip

    def _displaced(self) -> list[tuple[FloatArray, FloatArray]]:
        """By camera: displacements (n, 2) px of the joints' images, and m per px (n,) there."""
        points = np.concatenate([markers(self.body, frame.pose) for frame in self._frames])
        out = []
        for first, camera in zip(self._first, self.cameras, strict=True):
            pixels = project_camera(points, camera) - project_camera(points, first)
            depth = points @ first.T_cam_world[2, :3] + first.T_cam_world[2, 3]
            seen = np.isfinite(pixels).all(axis=1)
            if not seen.any():  # With the person behind it, its change displaces nothing.
                out.append((np.zeros((1, 2)), np.zeros(1)))
                continue
            out.append((pixels[seen], depth[seen] / first.matrix[0, 0]))
        return out

    def _iterate(self, truncation_m: float) -> None:
        """One step; equations that cannot be solved change nothing."""
        sums = self._summed(truncation_m)
        count = CHANGES * len(self.cameras)
        first, free = np.arange(count), self.free.ravel()
        precision = np.tile(1.0 / PRIOR_SD**2, len(self.cameras))
        sums.hessian[first, first] += np.where(free, precision, _HELD)
        sums.gradient[:count] += precision * self.changes.ravel()
        sums.gradient[:count] *= free
        sums.hessian[np.diag_indices_from(sums.hessian)] *= 1.0 + _DAMPING
        step = solved(sums.hessian, sums.gradient)
        if not np.isfinite(step).all():
            return
        step[:count] *= free
        step[count:] = self._body.take(step[count:])
        changes = step[:count].reshape(-1, CHANGES)
        self.cameras = [moved(c, one) for c, one in zip(self.cameras, changes, strict=True)]
        for frame, part in zip(self._frames, sums.parts, strict=True):
            frame.pose = np.clip(frame.pose - part @ np.append(step, 1.0), *self._limits)

    def _summed(self, truncation_m: float) -> _Sums:
        """Equations of cameras and body, poses eliminated; the cameras' priors are not in them."""
        sums = _Sums(CHANGES * len(self.cameras) + self._body.size)
        self._body.add_priors(sums.hessian, sums.gradient)
        longer, body = self._body.longer(), self.body
        for frame in self._frames:
            rows = self._collect(frame, truncation_m)
            points = surface(body, frame.pose, rows)
            by_camera = np.zeros((len(points), CHANGES * len(self.cameras)))
            for number, part in self._parts(frame):
                columns = slice(CHANGES * number, CHANGES * (number + 1))
                by_camera[part, columns] = change_jacobian(
                    self.cameras[number], points[part], rows.gradient[part]
                )
            jacobian = np.column_stack(
                [
                    pose_jacobian(body, frame.pose, rows),
                    by_camera,
                    self._body.jacobian(longer, frame.pose, rows, points),
                ]
            )
            own, pull = normal_equations(jacobian, frame.weight * _SCALE * rows.weight, rows.value)
            precision = frame.weight / body.prior_sd**2
            off = frame.pose - body.prior_mean
            add_pose_prior(own, pull, precision, off, damping=_DAMPING)
            sums.parts.append(eliminated(own, pull, body.size, sums.hessian, sums.gradient))
            residuals = float(frame.contours.residuals.cost.sum())
            sums.cost += frame.weight * _SCALE * residuals + 0.5 * float(precision @ off**2)
            sums.squares += frame.weight * float(rows.weight @ rows.value**2)
            sums.weight += frame.weight * float(rows.weight.sum())
        return sums

    def _collect(self, frame: _Frame, truncation_m: float) -> OutlineRows:
        """The residuals of a frame with the cameras, body and pose so far."""
        by_name = {camera.name: camera for camera in self.cameras}
        views = frame.contours.views
        for view, name in enumerate(views.names):
            put(views.arrays, view, by_name[name])
        frame.contours.collect(frame.pose, truncation_m, self.body)
        return outline_rows(frame.contours)

    def _parts(self, frame: _Frame) -> list[tuple[int, slice]]:
        """Number of the camera and rows of each view, after `_collect`."""
        names = [camera.name for camera in self.cameras]
        ends = np.cumsum([0, *frame.contours.residuals.count])
        return [
            (names.index(name), slice(int(ends[view]), int(ends[view + 1])))
            for view, name in enumerate(frame.contours.views.names)
        ]
