"""Time offsets of the cameras, from the tracked motion (temporal calibration).

A camera with a time offset d is late: it shows the body where it was d ago. The residuals of its
outline grow with the outline's velocity. Unknown beside the offsets are the pose of every frame
that is used, eliminated as in `ContourAdjustment`, and a constant shift of each camera's image,
which a wrong calibration causes. Equal offsets of all cameras cannot be distinguished from none:
offsets are relative to the median camera.

Large offsets are underestimated by about a quarter: the tracked pose follows the late camera, too,
and residuals are truncated.
"""

import pickle
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.calibration.contours.cameras import shift_jacobian
from markerless_tracker.calibration.contours.frames import contours_of
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness.contour import (
    add_pose_prior,
    eliminated,
    normal_equations,
    outline_rows,
    pose_jacobian,
    solved,
    surface,
)
from markerless_tracker.fitness.shape import CORRELATION_M
from markerless_tracker.fitness.shape.section_fit import RESIDUAL_SIGMA_M
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState

EVERY_NS = 60_000_000
"""Least time between two frames that are used; each takes some 7 ms of CPU time."""
SELDOM_NS = 1_000_000_000
"""The same once the offsets are known, and while sets come faster than they are tracked."""
GAP_NS = 100_000_000
"""Greatest time between neighbouring frames from which a velocity is computed."""
LEAST_SPEED_M_S = 0.15
"""Least root mean square speed of the markers in a frame that is used."""
BLOCK_FRAMES = 5
LEAST_BLOCKS = 8
"""Blocks of frames from which offsets are estimated."""
BLOCKS = 32
"""Most blocks that are kept; older ones are dropped."""
CERTAIN = 4.0
"""Least multiple of its standard deviation at which an offset is certain."""
LEAST_OFFSET_S = 0.005
"""Least offset that can be certain."""
_SETTLED_S = 0.003
_TRUNCATION_M = 0.1
_OFFSET_SD_S, _SHIFT_SD_PX = 0.1, 3.0
_SCALE = 1.0 / (CORRELATION_M * RESIDUAL_SIGMA_M**2)
_NUMBERS = 3


@dataclass(frozen=True)
class TimeOffset:
    """How late a camera's images are.

    Attributes:
        offset_s: by which its stamps are late, relative to the median camera.
        sd_s: standard deviation of that.
    """

    offset_s: float
    sd_s: float

    @property
    def certain(self) -> bool:
        """Whether the camera is late, or early, for sure."""
        return abs(self.offset_s) >= max(LEAST_OFFSET_S, CERTAIN * self.sd_s)


class TimeOffsetEstimate:
    """The cameras' time offsets; takes the results of a tracker, in order.

    Args:
        rig: the cameras of the images as the tracker gets them.
        step_px: as of `ContourFrame`.

    Attributes:
        by_camera: each camera's time offset; empty while too little motion was seen. Replaced as a
            whole: other threads may read it.
    """

    def __init__(self, rig: CameraRig, *, step_px: float) -> None:
        self.by_camera: Mapping[str, TimeOffset] = {}
        self._cameras = tuple(rig)
        self._step_px = step_px
        self._last: deque[tuple[TrackResult, BodyModel]] = deque(maxlen=3)
        self._used_ns: int | None = None
        # Where outlines are compared: residuals are only linear in small changes.
        self._near_s = np.zeros(len(self._cameras))
        self._blocks: deque[tuple[FloatArray, FloatArray]] = deque(maxlen=BLOCKS)
        self._new_block()

    def warm_up(self, body: BodyModel) -> None:
        """Compile what a frame needs, for bodies of this kind; the frames added last are lost."""
        observations = {}
        for camera in self._cameras:
            width, height = camera.size_px
            mask, undecided = np.zeros((2, height, width), dtype=np.uint8)
            mask[height // 4 : height // 2, width // 4 : width // 2] = 1
            undecided[height // 2 : height // 2 + 4, width // 4 : width // 2] = 1
            seen = Observation.from_mask(camera.name, 0, mask, mask, undecided=undecided)
            # Parts of an image need kernels that the whole image does not.
            observations[camera.name] = seen.cut((0, 0, width - 1, height - 1))
        pose = body.neutral
        made_up = TrackResult(
            0, TrackState.TRACKING, pose, markers(body, pose), 1.0, {}, 0, observations=observations
        )
        # Arrays that come from another process are not read-only: other kernels take them.
        for one in (made_up, pickle.loads(pickle.dumps(made_up))):
            self._take(one, body, np.zeros(body.size))
        self._new_block()

    def add(self, result: TrackResult, body: BodyModel) -> None:
        """Take a frame and the body that was tracked in it."""
        self._last.append((result, body))
        if len(self._last) < 3 or not self._due(self._last[1][0].stamp_ns, result.effort):
            return
        (before, _), (here, own), (after, later) = self._last
        gaps_ns = (here.stamp_ns - before.stamp_ns, after.stamp_ns - here.stamp_ns)
        # A body that is fitted anew moves without any motion.
        if not all(0 < gap_ns <= GAP_NS for gap_ns in gaps_ns) or own is not later:
            return
        first, last = _tracked(before), _tracked(after)
        if first is None or last is None or _tracked(here) is None:
            return
        seconds = sum(gaps_ns) * 1e-9
        speed_m_s = np.linalg.norm(last[1] - first[1], axis=1) / seconds
        if np.sqrt(np.nanmean(speed_m_s**2)) < LEAST_SPEED_M_S:
            return
        self._used_ns = here.stamp_ns
        self._take(here, own, (last[0] - first[0]) / seconds)
        if self._frames == BLOCK_FRAMES:
            self._blocks.append(self._block)
            self._new_block()
            if len(self._blocks) >= LEAST_BLOCKS:
                self._estimate()

    def _due(self, stamp_ns: int, effort: float) -> bool:
        """Whether a frame may be used; the tracker's effort is below 1 while it is overloaded."""
        if self._used_ns is None or stamp_ns < self._used_ns:
            return True
        seldom = bool(self.by_camera) or effort < 1.0
        return stamp_ns - self._used_ns >= (SELDOM_NS if seldom else EVERY_NS)

    def _estimate(self) -> None:
        """Estimate the offsets; if they are far from where outlines were compared, begin again."""
        hessian, gradient = (np.sum(part, axis=0) for part in zip(*self._blocks, strict=True))
        offsets_s = self._solved(hessian, gradient)
        if np.abs(offsets_s - self._near_s).max() > _SETTLED_S:
            self._near_s, self.by_camera = offsets_s, {}
            self._blocks.clear()
            return
        # Jackknife: frames that follow each other share their errors, blocks of them less.
        without = np.array([self._solved(hessian - h, gradient - s) for h, s in self._blocks])
        count = len(without)
        sd_s = np.sqrt((count - 1) / count * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
        self.by_camera = {
            camera.name: TimeOffset(float(offset_s), float(sd))
            for camera, offset_s, sd in zip(self._cameras, offsets_s, sd_s, strict=True)
        }

    def _solved(self, hessian: FloatArray, gradient: FloatArray) -> FloatArray:
        """The offsets (c,) relative to their median, s."""
        sd = np.tile([_OFFSET_SD_S, _SHIFT_SD_PX, _SHIFT_SD_PX], len(self._cameras))
        offsets_s = solved(hessian + np.diag(1.0 / sd**2), gradient)[::_NUMBERS]
        return np.asarray(offsets_s - np.median(offsets_s))

    def _take(self, result: TrackResult, body: BodyModel, velocity: FloatArray) -> None:
        """Add the equations of one frame: pose, then offset and shift (u, v) of each camera."""
        assert result.pose is not None
        size = body.size + _NUMBERS * len(self._cameras)
        hessian, gradient, views = np.zeros((size, size)), np.zeros(size), 0
        for number, camera in enumerate(self._cameras):
            observation = result.observations.get(camera.name)
            if observation is None or not observation.mask_words.any():
                continue
            views += 1
            own, pull = self._view(camera, observation, result.pose, body, velocity, number)
            at = np.r_[: body.size, body.size + _NUMBERS * number + np.arange(_NUMBERS)]
            hessian[np.ix_(at, at)] += own
            gradient[at] += pull
        if views < 2:
            return
        # The prior's mean is the tracked pose.
        precision = 1.0 / body.prior_sd**2
        add_pose_prior(hessian, gradient, precision, np.zeros(body.size), damping=0.0)
        eliminated(hessian, gradient, body.size, *self._block)
        self._frames += 1

    def _view(
        self,
        camera: CameraModel,
        observation: Observation,
        pose: FloatArray,
        body: BodyModel,
        velocity: FloatArray,
        number: int,
    ) -> tuple[FloatArray, FloatArray]:
        """Normal equations of one view."""
        near_s = self._near_s[number]
        shown = pose - near_s * velocity
        frame = contours_of(
            body, [camera], {camera.name: observation}, markers(body, shown),
            step_px=self._step_px, radius_m=_TRUNCATION_M,
        )  # fmt: skip
        frame.collect(shown, _TRUNCATION_M)
        rows = outline_rows(frame)
        by_pose = pose_jacobian(body, shown, rows)
        by_time = -(by_pose @ velocity)
        by_shift = shift_jacobian(camera, surface(body, shown, rows), rows.gradient)
        jacobian = np.column_stack([by_pose, by_time, by_shift])
        return normal_equations(jacobian, _SCALE * rows.weight, rows.value - near_s * by_time)

    def _new_block(self) -> None:
        size = _NUMBERS * len(self._cameras)
        self._block = (np.zeros((size, size)), np.zeros(size))
        self._frames = 0


def _tracked(result: TrackResult) -> tuple[FloatArray, FloatArray] | None:
    """Pose (p,) and markers (15, 3) of a frame; None unless the person is tracked."""
    if result.state is not TrackState.TRACKING or result.pose is None:
        return None
    return None if result.markers_m is None else (result.pose, result.markers_m)
