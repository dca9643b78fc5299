"""Makes the result of a frame from its search: whether the body is tracked, and how well."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.model import IntArray
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.contour import outline_rows
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.tracking.confidence import confidence_of, disagreement_m, jacobians
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.loss import event_of, shared_overlap
from markerless_tracker.tracking.search import FrameSearch
from markerless_tracker.tracking.smoothing import OneEuro
from markerless_tracker.tracking.states import Event, Track


@dataclass(frozen=True, eq=False)
class Found:
    """The pose that a search found in a frame.

    Attributes:
        search: the search, with its estimate.
        stamp_ns: time of the frame.
        observations: the evidence that it used.
        warnings: messages for the user, one line each.
        restarted: whether an automatic start found the pose, so that it does not continue the last.
        settling: whether that start needs further frames.
        rotated: whether another heading was found, so that the pose does not continue the last.
        jumped: indices of parameters that do not continue those of the last pose.
        recovered: whether a limb was found so far away that it was in a wrong place before.
        searched: whether limbs, or other poses, were compared with the estimate, which takes long.
    """

    search: FrameSearch
    stamp_ns: int
    observations: Mapping[str, Observation]
    warnings: tuple[str, ...] = ()
    restarted: bool = False
    settling: bool = False
    rotated: bool = False
    jumped: IntArray | None = None
    recovered: bool = False
    searched: bool = False


class Assessor:
    """Keeps the phase of the track and the states of the limbs; makes the results.

    Args:
        rig: the cameras.
        body: the body whose poses are smoothed.
        config: `refinement` and `smoothing`.

    Attributes:
        track: phase after the last frame.
        limbs: the limbs' states, and the searches for limbs.
    """

    def __init__(self, rig: CameraRig, body: BodyModel, config: TrackerConfig) -> None:
        self.limbs = LimbWatch(rig)
        self._with_confidence = config.refinement != "none"
        self._filter = OneEuro(body)
        self._smooth: OneEuro | None = None
        self.configure(config)
        self.reset()

    def configure(self, config: TrackerConfig) -> None:
        """Use another `smoothing` from the next frame on."""
        smooth = self._filter if config.smoothing == "one_euro" else None
        if smooth is not self._smooth:
            self._filter.reset()
        self._smooth = smooth

    def reset(self) -> None:
        """Forget all frames."""
        self.track = Track()
        self.limbs.reset()
        self.jump()

    def jump(self) -> None:
        """Restart the smoothing: the next pose does not continue the last one."""
        if self._smooth is not None:
            self._smooth.reset()

    def give_up(self) -> None:
        """End the track: the body was lost for too long."""
        self.track = self.track.after(Event.GIVEN_UP)
        self.limbs.reset()
        self.jump()

    def without_person(self, seen: Seen) -> TrackResult:
        """The result of a frame without a pose."""
        self.track = self.track.after(Event.NO_PERSON, seen.stamp_ns)
        if self.track.state is TrackState.SEARCHING:
            # The next person's limbs are not those of an abandoned start.
            self.limbs.reset()
            self.jump()
        lost = self.track.state is TrackState.LOST
        return TrackResult(
            stamp_ns=seen.stamp_ns, state=self.track.state, pose=None, markers_m=None,
            fitness=float("nan"), evaluations=0, observations=seen.observed, warnings=seen.notes,
            iou=dict.fromkeys(seen.observed, 0.0) if lost else {},
        )  # fmt: skip

    def warm_up(self, found: Found, body: BodyModel, limits: FloatArray) -> None:
        """Compile what `found` needs; same arguments."""
        self.found(found, body, limits)
        # `found` skips these if the pose does not match the evidence at all.
        jacobians(body, found.search.pose)
        disagreement_m(found.search.contours, outline_rows(found.search.contours))

    def found(self, found: Found, body: BodyModel, limits: FloatArray) -> TrackResult:
        """The result of a frame with a pose.

        Args:
            found: the pose and its evidence.
            body: the body of the search.
            limits: (2, p) joint limits.
        """
        search, warnings = found.search, found.warnings
        terms = search.terms()
        confidence = None
        if self._with_confidence:
            confidence = confidence_of(
                body, search.pose, search.contours,
                measured=body.measured, suspected_m=self.limbs.suspected_m,
                rivals=self.limbs.rivals,
            )  # fmt: skip
        overlap = shared_overlap(terms.values())
        event = Event.FOUND if found.settling else event_of(overlap, self.track.mean_overlap)
        self.track = self.track.after(event, found.stamp_ns, overlap)
        lost = self.limbs.lost
        limbs = self.limbs.assess(body, search.pose, found.observations, search.particle_sd_ratio)
        warnings += tuple(f"{name}: lost" for name in self.limbs.lost if name not in lost)
        pose = search.pose
        if found.restarted or found.rotated:
            self.jump()
        if self._smooth is not None:
            pose = np.clip(self._smooth(pose, found.stamp_ns), *limits)
        return TrackResult(
            stamp_ns=found.stamp_ns,
            state=self.track.state,
            pose=pose,
            markers_m=markers(body, pose),
            fitness=float(np.mean([t.silhouette + t.edges for t in terms.values()])),
            iou={name: t.overlap for name, t in terms.items()},
            evaluations=search.evaluations,
            refinements=search.refinements,
            observations=found.observations,
            warnings=warnings,
            confidence=confidence,
            limbs=limbs,
            settling=found.settling,
        )
