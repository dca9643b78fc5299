"""Fits the body to frames of a whole recording with poses as different as possible.

Bent and straight limbs, raised and hanging arms together show where joints are. Similar postures do
not: the outline does not change when a joint is moved along its limb.
"""

from collections.abc import Generator, Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.shape import BodyFit
from markerless_tracker.fitness.shape.pieces import at_once
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.person.body_fitting import TRUNCATION_M, Unmeasured
from markerless_tracker.tracking.person.spread import (
    EvenlySpread,
    most_different,
    posture_angles,
)
from markerless_tracker.tracking.refinement import floor_precision
from markerless_tracker.tracking.search import Searcher, make_searcher

MOST = 10
"""Number of frames that the body is fitted to. With more, the outlines outweigh the priors, which
determine what outlines do not show."""
MOST_KEPT = 8 * MOST
"""Number of frames that are kept to choose from."""
STEPS = 10
"""Gauss-Newton steps."""


@dataclass(frozen=True, eq=False)
class _Kept:
    stamp_ns: int
    pose: FloatArray
    observations: Mapping[str, Observation]


class WholeRecording:
    """Keeps frames evenly spread over a run of any length, and fits the body to some of them."""

    def __init__(self) -> None:
        self._kept: EvenlySpread[_Kept] = EvenlySpread(MOST_KEPT)

    def add(self, result: TrackResult) -> None:
        """Take a frame; frames that are not tracked are skipped."""
        if result.state is TrackState.TRACKING and result.pose is not None:
            self.keep(result.stamp_ns, result.pose, result.observations)

    def keep(
        self, stamp_ns: int, pose: FloatArray, observations: Mapping[str, Observation]
    ) -> None:
        """Take a tracked frame: its time, pose (p,) and evidence."""
        self._kept.offer(lambda: _Kept(stamp_ns, pose, dict(observations)))

    def chosen(self, body: BodyModel) -> list[int]:
        """Indices of at most `MOST` kept frames, ascending, with postures as different as possible.

        Postures are compared by `posture_angles`. The frame in the middle of the run is included.
        """
        angles = posture_angles(body)
        poses = np.array([frame.pose[angles] for frame in self._kept.items])
        order = most_different(len(poses), MOST, lambda i: np.linalg.norm(poses - poses[i], axis=1))
        return sorted(order)

    def fitted(
        self, rig: CameraRig, body: BodyModel, config: TrackerConfig, person: Unmeasured
    ) -> BodyModel:
        """The body fitted to the chosen frames; unchanged if there is no frame.

        Args:
            rig: the cameras.
            body: the body that was tracked last.
            config: of the tracker.
            person: what is known of the person.
        """
        if not self._kept.items:
            return body
        searcher = make_searcher(body, rig=rig, config=config, threads=1)
        return at_once(self.fitting(searcher, person))

    def fitting(
        self, searcher: Searcher, person: Unmeasured, steps: int = STEPS
    ) -> Generator[None, None, BodyModel]:
        """`fitted` in pieces, each with the evidence of a frame, or its equations in a step.

        Args:
            searcher: with the body that was tracked last; not used while another frame is searched.
            person: what is known of the person.
            steps: Gauss-Newton steps.
        """
        body, config = searcher.body, searcher.config
        fit = BodyFit(
            person.sizes, body, person.sizes.prior(person.stature_m), joint_limits(body, config),
            varied=True, floor_precision=floor_precision(config),
        )  # fmt: skip
        for frame in [self._kept.items[i] for i in self.chosen(body)]:
            search = searcher.frame(
                frame.observations, frame.stamp_ns, frame.pose, radius_m=searcher.tracked_radius_m
            )
            fit.add(search.contours, frame.pose)
            yield
        for truncation_m in np.geomspace(*TRUNCATION_M, steps):
            yield from fit.pieces(float(truncation_m))
        return fit.body
