"""Detects a camera that disagrees with the others: its silhouettes are shifted from the body.

At intervals, for each camera in turn, the pose is refined on the other cameras' silhouettes. Then
the image shift is estimated that fits the body's outline best to this camera's silhouette. A shift
that persists over a run is due neither to motion nor to segmentation: the calibration of a camera
is wrong. The camera across shows about the opposite shift. The wrong one is that whose shift makes
all silhouettes agree better with one pose.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.refinement import pose_prior, refined_on_contours
from markerless_tracker.tracking.search import FrameSearch, Searcher, root_m

DISAGREES_M = 0.030
"""Least persistent shift, at the body's distance, that is attributed to the calibration."""
EVERY_NS = (80_000_000, 400_000_000, 2_000_000_000)
"""Time between the first `FEW_CHECKS` checks, between those up to `MANY_CHECKS`, and later."""
FEW_CHECKS, MANY_CHECKS = 3, 12
"""Least number of checks that tell whether a camera is wrong; number whose median is precise."""
DENSE_NS = 40_000_000
"""If frames follow each other faster than this, those that took long put comparisons off, for at
most this time."""
REMEMBERED = 30
"""Number of a camera's latest checks that count, so that a camera may be touched during a run."""
LEAST_VIEWS = 3
"""Least number of views: of two views that disagree, either may be wrong."""
_ITERATIONS, _TRUNCATION_M = 4, (0.10, 0.035)
"""Refinement without a camera: its iterations, and the first and last truncation."""
_CANDIDATE_M = 0.020
"""Least shift of a camera that may be the wrong one, once a camera disagrees."""
_GAIN_TRUNCATION_M = 0.05
"""Truncation of the cost by which these cameras are compared."""
_LEAD = 0.1
"""A camera is the wrong one if the others' gains are lower than its own by this fraction."""
_SHIFT_STEPS, _SHIFT_TRUNCATION_M = 3, 0.10
"""Estimate of a shift: its steps and their truncation."""


@dataclass(frozen=True)
class Shift:
    """Shift of one camera's silhouettes from the body as the other cameras see it.

    Attributes:
        px: (u, v), medians over the checks, at the scale of the tracked images.
        length_m: its length at the body's distance.
        checks: number of frames in which it was estimated.
        corrected: whether its image is shifted back.
    """

    px: tuple[float, float]
    length_m: float
    checks: int
    corrected: bool = False

    @property
    def m_per_px(self) -> float:
        """Size of a pixel at the body's distance, m."""
        return self.length_m / max(float(np.hypot(*self.px)), 1e-9)

    @property
    def disagrees(self) -> bool:
        """Whether the shift is too large to be chance."""
        return self.checks >= FEW_CHECKS and self.length_m >= DISAGREES_M

    def as_mapping(self) -> dict[str, Any]:
        """For JSON: the entry of a camera in `cameras`."""
        return {
            "shift_px": [round(value, 2) for value in self.px],
            "shift_mm": round(1000.0 * self.length_m, 1),
            "checks": self.checks,
            "disagrees": self.disagrees,
            "corrected": self.corrected,
        }


class CameraCheck:
    """Compares each camera with the others over a run.

    The cameras are compared in rotation, so that no frame takes much longer than others.

    Args:
        rig: the cameras as calibrated.
        config: the tracker's settings.

    Attributes:
        suspects: the cameras that are wrong; the others are compared without them.
        shares: probability that a camera is wrong, of those that may be.
    """

    def __init__(self, rig: CameraRig, config: TrackerConfig) -> None:
        self._rig = rig
        self._config = config
        self.reset()

    def configure(self, config: TrackerConfig) -> None:
        """Use other settings from the next frame on."""
        self._config = config

    def reset(self) -> None:
        """Forget all frames."""
        self._due_ns: int | None = None
        self._last_ns: int | None = None
        self._compared = 0
        self.suspects: frozenset[str] = frozenset()
        self.shares: dict[str, float] = {}
        self._found: dict[str, deque[tuple[float, float, float]]] = {}
        self._begin()

    def _begin(self) -> None:
        """Begin the checks of the cameras that are not suspected."""
        self._checks = 0
        self._gains: deque[dict[str, float]] = deque(maxlen=REMEMBERED)
        for name in self._rig.names:
            if name not in self.suspects:
                self._found[name] = deque(maxlen=REMEMBERED)

    def add(
        self,
        result: TrackResult,
        body: BodyModel,
        *,
        search: FrameSearch | None = None,
        late: bool = False,
        searched: bool = False,
    ) -> bool:
        """Take a tracked frame: compare the cameras whose turn has come; often there is none.

        Args:
            result: of the frame.
            body: the tracked body.
            search: of the frame, whose contour evidence is used; None to make it anew.
            late: whether sets come faster than they are tracked. Then at most one camera is
                compared, and after the first `FEW_CHECKS` checks they come as seldom as later ones.
            searched: whether limbs or other poses were compared in this frame, so that it took
                long. If frames are dense, cameras are compared in the next frame without.

        Returns:
            Whether all have been compared once more, so that `shares` may have changed.
        """
        if result.state is not TrackState.TRACKING or result.pose is None:
            return False
        if self._due_ns is None or self._due_ns - result.stamp_ns > EVERY_NS[-1]:
            # The first frame, or time was set back.
            self._due_ns = result.stamp_ns
        last_ns, self._last_ns = self._last_ns, result.stamp_ns
        dense = last_ns is not None and 0 <= result.stamp_ns - last_ns < DENSE_NS
        if dense and searched and result.stamp_ns < self._due_ns + DENSE_NS:
            return False
        count, checks = len(self._rig), 0
        for _ in range(1 if late else count):
            if result.stamp_ns < self._due_ns:
                return checks > 0
            search = search or self._search(result, result.pose, body)
            self._compare(self._rig.names[self._compared], search.contours, result.pose, body)
            self._compared = (self._compared + 1) % count
            self._due_ns += self._every_ns(late) // count
            if self._compared == 0:
                checks += 1
                self._checks += 1
                self._weigh(search.contours, result.pose, body)
                self._suspect()
        # Frames come less often than checks are due.
        self._due_ns = max(self._due_ns, result.stamp_ns)
        return checks > 0

    def _every_ns(self, late: bool) -> int:
        phase = (self._checks >= FEW_CHECKS) + (self._checks >= MANY_CHECKS)
        return EVERY_NS[-1 if late and phase else phase]

    def _search(self, result: TrackResult, pose: FloatArray, body: BodyModel) -> FrameSearch:
        searcher = Searcher(self._rig, body, self._config, limits=body.limits, threads=1)
        return searcher.frame(result.observations, result.stamp_ns, pose)

    def _compare(
        self, name: str, contours: ContourFrame, pose: FloatArray, body: BodyModel
    ) -> None:
        """Estimate the shift of one camera from the body as the others see it."""
        seen = self._seen(contours)
        others = [c for c in seen if c.name != name and c.name not in self.suspects]
        if self._rig[name] not in seen or len(others) < LEAST_VIEWS - 1:
            return
        without = _refined(contours.seen_by(others, body), pose, self._config)
        shift = _shift(contours.seen_by([self._rig[name]], body), self._rig[name], without)
        if shift is not None:
            self._found[name].append(shift)

    def _weigh(self, contours: ContourFrame, pose: FloatArray, body: BodyModel) -> None:
        """Estimate how much each camera that may be wrong explains, all in the same frame."""
        seen = [c for c in self._seen(contours) if c.name not in self.suspects]
        names = {camera.name for camera in seen}
        shifts = {
            name: shift.px
            for name, shift in self.shifts().items()
            if name in names and shift.length_m >= _CANDIDATE_M
        }
        # As many views as a suspicion needs.
        if not shifts or len(seen) <= LEAST_VIEWS:
            return
        self._gains.append(_gains(contours.seen_by(seen, body), pose, shifts, self._config))

    def _seen(self, contours: ContourFrame) -> list[CameraModel]:
        """The cameras that see the person, as calibrated."""
        views = contours.views
        seen = {n for n, count in zip(views.names, views.arrays.observed, strict=True) if count}
        return [camera for camera in self._rig if camera.name in seen]

    def shifts(self) -> dict[str, Shift]:
        """The shift of every camera that could be compared, by name."""
        out = {}
        for name, found in self._found.items():
            if found:
                u, v, scale = np.median(np.array(found), axis=0)
                length = float(np.hypot(u, v)) / float(scale)
                out[name] = Shift((float(u), float(v)), length, len(found))
        return out

    def _suspect(self) -> None:
        """Find the wrong camera; it is excluded from the others' checks, which begin anew."""
        before = self.shares
        self.shares = {name: 1.0 for name in self._rig.names if name in self.suspects}
        doubted = [
            name
            for name, shift in self.shifts().items()
            if name not in self.suspects
            and (shift.disagrees or (name in before and shift.length_m >= _CANDIDATE_M))
        ]
        if not doubted or len(self._rig) - len(self.suspects) - 1 < LEAST_VIEWS:
            return
        # Only gains in the same frames are comparable.
        weighed = [gains for gains in self._gains if all(name in gains for name in doubted)]
        if len(weighed) < FEW_CHECKS:
            self.shares = before
            return
        gains = {name: float(np.mean([each[name] for each in weighed])) for name in doubted}
        first, *others = sorted(gains, key=gains.__getitem__, reverse=True)
        if gains[first] <= 0.0:
            return
        lead = 1.0 - max((gains[name] for name in others[:1]), default=0.0) / gains[first]
        sure = lead >= _LEAD or len(weighed) >= MANY_CHECKS
        self.shares[first] = 1.0 if sure else 0.5 + 0.5 * lead / _LEAD
        if not sure:
            self.shares[others[0]] = 1.0 - self.shares[first]
            return
        self.suspects |= {first}
        self._begin()


def describe(shifts: Mapping[str, Shift]) -> list[str]:
    """A line for each camera that disagrees with the others."""
    return [
        f"{name}: silhouettes ({shift.px[0]:+.1f}, {shift.px[1]:+.1f}) px, "
        f"{1000.0 * shift.length_m:.0f} mm, beside the body as the other cameras see it; "
        + ("its image was shifted back, " if shift.corrected else "")
        + "check its calibration"
        for name, shift in shifts.items()
        if shift.disagrees
    ]


def _refined(frame: ContourFrame, pose: FloatArray, config: TrackerConfig) -> FloatArray:
    """A pose (p,) refined on these views only."""
    return refined_on_contours(
        frame,
        pose,
        config,
        priors=(pose_prior(frame.body),),
        limits=frame.body.limits,
        iterations=_ITERATIONS,
        truncation_m=_TRUNCATION_M,
    )


def _gains(
    frame: ContourFrame,
    pose: FloatArray,
    shifts_px: Mapping[str, tuple[float, float]],
    config: TrackerConfig,
) -> dict[str, float]:
    """How much less it costs to explain all views if one camera is shifted, m³, by camera."""
    intrinsics = frame.views.arrays.intrinsics

    def cost() -> float:
        frame.collect(_refined(frame, pose, config), _GAIN_TRUNCATION_M)
        return float(frame.residuals.cost.sum())

    before, gains = cost(), {}
    for name, shift_px in shifts_px.items():
        view = frame.views.names.index(name)
        centre = intrinsics[view, [2, 4]]
        intrinsics[view, [2, 4]] = centre + shift_px
        gains[name] = before - cost()
        intrinsics[view, [2, 4]] = centre
    return gains


def _shift(
    frame: ContourFrame, camera: CameraModel, pose: FloatArray
) -> tuple[float, float, float] | None:
    """Shift (u, v) px with which the body fits one view's silhouette, and px per metre.

    Weighted least squares on the contours' residuals, repeated with the camera moved by the shift
    so far, since larger residuals have less weight.

    Args:
        frame: the view; its principal point is moved.
        camera: of the view.
        pose: (p,).
    """
    to_camera = camera.T_cam_world
    depth = float(to_camera[2, :3] @ root_m(frame.body, pose) + to_camera[2, 3])
    if depth <= 0.0:
        return None
    focal = np.array([camera.matrix[0, 0], camera.matrix[1, 1]])
    intrinsics, residuals = frame.views.arrays.intrinsics, frame.residuals
    # The silhouette is fixed; the principal point is moved.
    centre = intrinsics[0, [2, 4]]
    shift = np.zeros(2)
    for _ in range(_SHIFT_STEPS):
        intrinsics[0, [2, 4]] = centre + shift
        frame.collect(pose, _SHIFT_TRUNCATION_M)
        rows = slice(int(residuals.count[0]))
        value, weight = residuals.value[0, rows], residuals.weight[0, rows]
        jacobian = residuals.gradient[0].T[rows] @ to_camera[:2, :3].T * (depth / focal)
        normal = jacobian.T @ (weight[:, None] * jacobian)
        if np.linalg.matrix_rank(normal) < 2:
            return None
        shift = shift - np.linalg.solve(normal, jacobian.T @ (weight * value))
    return float(shift[0]), float(shift[1]), float(focal.mean()) / depth
