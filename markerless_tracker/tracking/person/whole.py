"""The body of a person from frames of a whole recording, in poses as different as possible.

Bent and straight limbs, raised and hanging arms show where joints are. A few similar postures do
not: the outline stays the same when a joint is moved along its limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.shape import BodyFit
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.person.body_fitting import TRUNCATION_M, Unmeasured
from markerless_tracker.tracking.person.spread import EvenlySpread, most_different
from markerless_tracker.tracking.refinement import floor_precision
from markerless_tracker.tracking.search import make_searcher

MOST = 10
"""Frames that the body is fitted to. With more the outlines outweigh the priors, which hold what
outlines do not show."""
MOST_KEPT = 8 * MOST
"""Frames that are kept to choose from."""
STEPS = 10
"""Gauss-Newton steps."""


@dataclass(frozen=True, eq=False)
class _Kept:
    stamp_ns: int
    pose: FloatArray
    observations: Mapping[str, Observation]


class WholeRecording:
    """Keeps frames of a run of any length, evenly spread over it, and fits the body to some."""

    def __init__(self) -> None:
        self._kept: EvenlySpread[_Kept] = EvenlySpread(MOST_KEPT)

    def add(self, result: TrackResult) -> None:
        """Take a frame; those that are not tracked are passed over."""
        pose = result.pose
        if result.state is TrackState.TRACKING and pose is not None:
            self._kept.offer(lambda: _Kept(result.stamp_ns, pose, dict(result.observations)))

    def chosen(self, body: BodyModel) -> list[int]:
        """At most `MOST` of the kept frames, ascending, each as far as possible from the others.

        By the joints' angles, without the root's; the one in the middle of the run is among them.
        """
        frames = self._kept.items
        angles = np.setdiff1d(body.joints, body.root)
        poses = np.array([frame.pose[angles] for frame in frames])
        order = most_different(
            len(frames), MOST, lambda i: np.linalg.norm(poses - poses[i], axis=1)
        )
        return sorted(order)

    def fitted(
        self, rig: CameraRig, body: BodyModel, config: TrackerConfig, person: Unmeasured
    ) -> BodyModel:
        """The body fitted to the chosen frames; as it was without any.

        Args:
            rig: the cameras.
            body: that was tracked last.
            config: of the tracker.
            person: what is known of the person.
        """
        limits = joint_limits(body, config)
        prior = person.sizes.prior(person.stature_m)
        fit = BodyFit(
            person.sizes, body, prior, limits, varied=True, floor_precision=floor_precision(config)
        )
        searcher = make_searcher(body, rig=rig, config=config, threads=1)
        chosen = self.chosen(body)
        for frame in (self._kept.items[i] for i in chosen):
            search = searcher.frame(
                frame.observations, frame.stamp_ns, frame.pose, reach_m=searcher.tracked_reach_m
            )
            fit.add(search.contours, frame.pose)
        if not chosen:
            return body
        for truncation_m in np.geomspace(*TRUNCATION_M, STEPS):
            fit.iterate(float(truncation_m))
        return fit.body
