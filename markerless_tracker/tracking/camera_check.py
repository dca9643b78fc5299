"""Detects a camera that disagrees with the others: its silhouettes are shifted from the body.

At intervals, for each camera in turn, the pose is refined on the other cameras' silhouettes. Then
the image shift is estimated that fits the body's outline best to this camera's silhouette. A shift
that persists over a run is due neither to motion nor to segmentation: the calibration of the camera
is wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness.arrays import lay_out_views
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.refinement import pose_prior, refined_on_contours
from markerless_tracker.tracking.search import Searcher, pixels_per_m, root_m

DISAGREES_M = 0.030
"""Least persistent shift, at the body's distance, that is attributed to the calibration."""
EVERY_NS, LATER_EVERY_NS = 160_000_000, 800_000_000
"""Time between the first `MANY_CHECKS` checks, and between later ones."""
MANY_CHECKS = 12
"""Number of checks whose median is a reliable shift, so that later checks may be rarer."""
LEAST_VIEWS = 3
"""Least number of views: of two views that disagree, either may be wrong."""
_FIRST_NS = 300_000_000
"""Time from the first tracked frame to the first check."""
_LEAST_CHECKS = 3
_ITERATIONS, _TRUNCATION_M = 4, (0.10, 0.035)
"""Refinement without a camera: its iterations, and the first and last truncation."""
_SHIFT_STEPS, _SHIFT_TRUNCATION_M = 3, 0.10
"""Estimate of a shift: its steps and their truncation."""


@dataclass(frozen=True)
class Shift:
    """Shift of one camera's silhouettes from the body as the other cameras see it.

    Attributes:
        px: (u, v), medians over the checks, at the scale of the tracked images.
        length_m: its length at the body's distance.
        checks: number of frames in which it was estimated.
    """

    px: tuple[float, float]
    length_m: float
    checks: int

    @property
    def disagrees(self) -> bool:
        """Whether the shift is too large to be chance."""
        return self.checks >= _LEAST_CHECKS and self.length_m >= DISAGREES_M


class CameraCheck:
    """Compares each camera with the others over a run.

    Args:
        rig: the cameras, as the tracker has them.
        config: its settings.
    """

    def __init__(self, rig: CameraRig, config: TrackerConfig) -> None:
        self._rig = rig
        self._config = config
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._checks = 0
        self._searcher: Searcher | None = None
        self._suspects: frozenset[str] = frozenset()
        self._found: dict[str, list[tuple[float, float, float]]] = {n: [] for n in rig.names}

    def add(self, result: TrackResult, body: BodyModel) -> None:
        """Take a frame; most frames are skipped."""
        if result.state is not TrackState.TRACKING or result.pose is None:
            return
        if self._first_ns is None:
            self._first_ns = result.stamp_ns
        every_ns = EVERY_NS if self._checks < MANY_CHECKS else LATER_EVERY_NS
        if result.stamp_ns - self._first_ns < _FIRST_NS or (
            self._last_ns is not None and result.stamp_ns - self._last_ns < every_ns
        ):
            return
        seen = {n: o for n, o in result.observations.items() if o.mask_words.any()}
        if len(seen) < LEAST_VIEWS:
            return
        self._last_ns = result.stamp_ns
        self._checks += 1
        if self._searcher is None or self._searcher.body is not body:
            self._searcher = Searcher(self._rig, body, self._config, limits=body.limits, threads=1)
        searcher = self._searcher
        for name in seen:
            others = {n: o for n, o in seen.items() if n != name and n not in self._suspects}
            if len(others) < LEAST_VIEWS - 1:
                continue
            pose = _refined(searcher, others, result)
            shift = _shift(searcher, seen[name], self._rig[name], pose)
            if shift is not None:
                self._found[name].append(shift)
        self._suspect()

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
        """Exclude the camera that disagrees most from the others' checks, which begin anew."""
        others = {n: shift for n, shift in self.shifts().items() if n not in self._suspects}
        worst = max(others.items(), key=lambda item: item[1].length_m, default=None)
        if worst is None or not worst[1].disagrees:
            return
        if len(self._rig) - len(self._suspects) - 1 < LEAST_VIEWS:
            return
        self._suspects |= {worst[0]}
        self._checks = 0
        for name in self._found:
            if name not in self._suspects:
                self._found[name] = []


def describe(shifts: Mapping[str, Shift]) -> list[str]:
    """A line for each camera that disagrees with the others."""
    return [
        f"{name}: silhouettes ({shift.px[0]:+.1f}, {shift.px[1]:+.1f}) px, "
        f"{1000.0 * shift.length_m:.0f} mm, beside the body as the other cameras see it; "
        "check its calibration"
        for name, shift in shifts.items()
        if shift.disagrees
    ]


def _refined(
    searcher: Searcher, observations: Mapping[str, Observation], result: TrackResult
) -> FloatArray:
    """The result's pose (p,) refined on these views only."""
    assert result.pose is not None
    contours = searcher.frame(observations, result.stamp_ns, result.pose).contours
    return refined_on_contours(
        contours,
        result.pose,
        searcher.config,
        priors=(pose_prior(searcher.body),),
        limits=searcher.limits,
        iterations=_ITERATIONS,
        truncation_m=_TRUNCATION_M,
    )


def _shift(
    searcher: Searcher, observation: Observation, camera: CameraModel, pose: FloatArray
) -> tuple[float, float, float] | None:
    """Shift (u, v) px with which the body fits one view's silhouette, and px per metre.

    Weighted least squares on the contours' residuals, repeated with the camera moved by the shift
    so far, since larger residuals have less weight.
    """
    to_camera, name = camera.T_cam_world, camera.name
    at = root_m(searcher.body, pose)
    depth = float(to_camera[2, :3] @ at + to_camera[2, 3])
    if depth <= 0.0:
        return None
    focal = np.array([camera.matrix[0, 0], camera.matrix[1, 1]])
    views = lay_out_views([camera], {name: observation})
    contours = ContourFrame(
        searcher.body,
        {name: camera},
        {name: observation},
        views,
        pixels_per_m={name: pixels_per_m(camera, at)},
        step_px=searcher.config.edges.step_px,
    )
    # The silhouette is fixed; the principal point is moved.
    centre = views.arrays.intrinsics[0, [2, 4]]
    shift = np.zeros(2)
    for _ in range(_SHIFT_STEPS):
        views.arrays.intrinsics[0, [2, 4]] = centre + shift
        contours.collect(pose, _SHIFT_TRUNCATION_M)
        rows = slice(int(contours.residuals.count[0]))
        value, weight = contours.residuals.value[0, rows], contours.residuals.weight[0, rows]
        jacobian = contours.residuals.gradient[0, rows] @ to_camera[:2, :3].T * (depth / focal)
        normal = jacobian.T @ (weight[:, None] * jacobian)
        if np.linalg.matrix_rank(normal) < 2:
            return None
        shift = shift - np.linalg.solve(normal, jacobian.T @ (weight * value))
    return float(shift[0]), float(shift[1]), float(focal.mean()) / depth
