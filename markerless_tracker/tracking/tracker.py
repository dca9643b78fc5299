"""The tracker: `Tracker.step` finds the pose that explains the views of one time."""

import copy
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Region, Segmenter
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking.assess import Assessor, Found
from markerless_tracker.tracking.cameras.check import Shift
from markerless_tracker.tracking.cameras.correction import CameraCorrection
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.gather import EvidenceMaker
from markerless_tracker.tracking.evidence.hull import find_hulls
from markerless_tracker.tracking.evidence.observer import Observer
from markerless_tracker.tracking.evidence.prepared import Lookahead, Outlook, Prepared, Views
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.evidence.views import ViewWatch, anybody
from markerless_tracker.tracking.limbs.recovered import RECOVERED_M, Recovered
from markerless_tracker.tracking.limits import LIMB_RAD_S, check_pose, joint_speeds
from markerless_tracker.tracking.motion import MotionModel
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.estimate import BodyEstimate
from markerless_tracker.tracking.person.first_frame import StartMarkers
from markerless_tracker.tracking.person.resting import at_rest
from markerless_tracker.tracking.searchers import Searchers
from markerless_tracker.tracking.stages.effort import Effort
from markerless_tracker.tracking.stages.frame import frame_stages, swarm_stages
from markerless_tracker.tracking.start.required import missing_for_start, require_parts_of_a_start
from markerless_tracker.tracking.start.starter import Starter
from markerless_tracker.tracking.states import Phase, Track


class Tracker:
    """Tracks one person frame by frame, from a start pose or from an automatic start.

    Uses no clock, no ROS and no files: results depend on the arguments only. The same arguments
    give the same bytes with any number of threads. `prepare` alone may be called beside a step.

    Args:
        rig: the cameras; views are named after them.
        body: the body with the person's sizes.
        config: every setting.
        start_pose: (p,) pose near which the first frame is searched; None = find a person
            automatically, which takes some frames.
        backgrounds: the empty scene per camera; cameras without one take observations only.
        shape_known: whether the body's sections are this person's; if not, and `fit_shape` is set,
            they are fitted to the first frame's silhouettes with the start pose held.
        start_markers: the markers that the start pose was computed from; noisy ones are refined on
            the first frame's silhouettes before the sections are fitted.
        person: what is known of a person whose lengths were not measured; None if they were.

    Raises:
        BodyModelError: the start pose has another size, is not finite or breaks a joint limit.
        ConfigError: the budget cannot be spent.
        ImageError: a background does not fit its camera.
    """

    def __init__(
        self,
        rig: CameraRig,
        body: BodyModel,
        config: TrackerConfig,
        *,
        start_pose: FloatArray | None = None,
        backgrounds: Mapping[str, BackgroundModel] | None = None,
        shape_known: bool = False,
        start_markers: StartMarkers | None = None,
        person: Unmeasured | None = None,
    ) -> None:
        self.config = config
        self._given = start_pose is not None
        start = np.array(body.neutral if start_pose is None else start_pose, np.float64)
        check_pose(body, start, None)
        if self._given and body.measured:
            body = at_rest(body, start)
        self._body = BodyEstimate(
            body, config, shape_known=shape_known, start_markers=start_markers, person=person
        )
        check_pose(body, start, self._body.limits if self._given else None)
        # Raises now, not at the first frame, if the budget cannot be spent.
        frame_stages(body, config, start, body.sigma)
        self._searchers = Searchers(rig, config)
        self.evidence = EvidenceMaker(rig, config, backgrounds or {}, self._searchers.mapper)
        self._views = ViewWatch(rig)
        self._observer = Observer(self.evidence, self._views)
        self._correction = CameraCorrection(rig, config)
        self._motion = MotionModel(start, config)
        self._assessor = Assessor(rig, body, config)
        self._use_cameras(rig)
        self._effort = Effort(needed_only=config.refine.swarms == "needed")
        self._start = None if self._given else self._new_start()
        self._lookahead = Lookahead(self._outlook(-1), self._outlook(0))

    @property
    def state(self) -> TrackState:
        """State after the last step."""
        return self._assessor.track.state

    @property
    def shifts(self) -> dict[str, Shift]:
        """By camera, how far its silhouettes lie beside the body as the others see it."""
        return self._correction.shifts()

    @property
    def body(self) -> BodyModel:
        """The present estimate of the person's body."""
        return self._body.body

    def reset(self) -> None:
        """Return to before the first step; a background that follows the images is kept."""
        self._views.reset()
        self._motion.reset()
        self._body.reset()
        self._assessor.reset()
        self._effort.reset()
        self._correction.reset()
        self._use_cameras(self._correction.rig)
        self._start = None if self._given else self._new_start()
        self._lookahead.restart(self._outlook(-1), self._outlook(0))

    def configure(self, config: TrackerConfig) -> None:
        """Use other `live_settings` from the next step on; the track continues, and so does a start
        that has begun.

        Raises:
            ConfigError: the budget cannot be spent, or the body lacks what `search_again` takes.
        """
        frame_stages(self.body, config, self._motion.pose, self.body.sigma)
        if config.search_again:
            require_parts_of_a_start(self.body)
        self.config = config
        for part in (self._motion, self._body, self._assessor, self._effort, self._correction):
            part.configure(config)
        self._searchers.config = config
        self._searcher = self._searchers.near(self.body)

    def warm_up(self) -> None:
        """Compile every kernel, so that no later step waits for it; then `reset`."""
        self.evidence.start_compiling()  # in the segmenting process, meanwhile
        made_up, pose = self.evidence.made_up(), self._motion.pose
        seen = Seen(0, made_up, decide(made_up, self._searcher.cameras, self.body, pose), made_up)
        next(find_hulls(self._searcher.cameras, made_up), None)
        search = self._searcher.frame(seen.used, 0, pose)
        search.run(swarm_stages(self.body, self.config, pose, self.body.sigma))
        # What the segmenting process compiles is not compiled twice.
        self.evidence.finish_compiling()
        self._start, self._assessor.track = None, Track(Phase.TRACKING)
        self.step(made_up, 0)
        if self.config.refinement != "none" and not missing_for_start(self.body):
            self._assessor.limbs.recover(self._searcher, search.contours, seen, pose)
        self._assessor.warm_up(Found(search, 0, seen.used), self.body, self._body.limits)
        self.reset()
        self._body.warm_up(self._searchers.near, made_up, self._motion.pose)
        self.reset()

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use other backgrounds from now on; then `warm_up`, which resets.

        Args:
            backgrounds: by camera; cameras without one take ready-made observations only.

        Raises:
            ImageError: a background does not fit its camera; nothing has changed then.
        """
        self.evidence.take_backgrounds(backgrounds)
        self.warm_up()

    def regions(self, stamp_ns: int) -> dict[str, Region | None]:
        """Region of each camera's image that `step` would use at a time; None = whole image.

        It follows from the pose of the set before the last one, so that it is known while the last
        set is fitted. If the region cuts the person off, a wider one is used, or the whole image.
        """
        return self.evidence.regions(self._lookahead.current, stamp_ns)

    def segmenter(self, camera: str) -> Segmenter | None:
        """The segmenter of a camera; None without a background."""
        return self.evidence.segmenters.get(camera)

    def prepare(self, views: Views, stamp_ns: int) -> Prepared:
        """Make the evidence of the set after the one that `step` processes now.

        May be called from another thread while `step` runs, once per set and in the order of the
        sets. `step` with the returned object gives the same bytes as `step` with the views. Without
        a step in progress, or if nothing can be made ahead, this saves no time.

        Args:
            views: as `step` takes them; the images must not change until their step has ended.
            stamp_ns: time of the images.

        Raises:
            ImageError, CalibrationError: as `step`.
        """
        # A background that follows the images must get them in the order of the steps.
        if self.config.background.follow_s > 0.0:
            return Prepared(views, stamp_ns, None, {}, 0)
        return self._lookahead.prepare(partial(self.evidence.segment, ahead=True), views, stamp_ns)

    def step(self, views: Views | Prepared, stamp_ns: int, effort: float = 1.0) -> TrackResult:
        """Find the pose that explains the views of one time.

        Args:
            views: camera name to its image, (h, w, 3) uint8 BGR or (h, w) grey, not rectified, or
                to a ready-made observation; cameras may be missing. Or the result of `prepare`.
            stamp_ns: time of the images; the search widens with the time since the last step.
            effort: fraction, 0 to 1, of the frames explained as usual that are searched further.

        Raises:
            ConfigError: the effort is not between 0 and 1.
            ImageError, CalibrationError: there is no view, or a view of an unknown camera, or one
                that does not fit its calibration or background; names the camera.
        """
        doubt, since_s = bool(self._assessor.limbs.lost), self._motion.since_s(stamp_ns)
        self._effort.begin(effort, doubt=doubt, since_s=since_s)
        outlook = self._lookahead.begin(views if isinstance(views, Prepared) else None)
        latest = None
        try:
            result = self._step(views, stamp_ns, outlook)
            latest = self._outlook(outlook.number + 2)
        finally:
            self._lookahead.end(latest)
        return replace(result, effort=effort)

    def _step(self, views: Views | Prepared, stamp_ns: int, outlook: Outlook) -> TrackResult:
        if self.config.search_again and self._assessor.track.given_up:
            self._assessor.give_up()
            self._effort.reset()
            self._start = self._new_start(self._motion.pose)
        views, made = self._lookahead.made(views, stamp_ns, outlook)
        evidence = made or self.evidence.segment(views, stamp_ns, outlook)
        predicted = self._motion.predict(stamp_ns, self._body.limits)
        body, cameras = self.body, self._searcher.cameras
        if self._start is not None:
            seen = self._observer.whole(evidence, stamp_ns, body)
            found = self._search_room(self._start, seen)
        else:
            seen = self._observer.near(evidence, stamp_ns, body, predicted, cameras, self.state)
            found = self._search_near(predicted, seen)
        if found is None:
            result = self._assessor.without_person(seen)
            self._motion.lose()
        else:
            result = self._assessor.found(found, self.body, self._body.limits)
            result = replace(result, warnings=result.warnings + self._learn(found, result))
        exposure = {n: v.exposure for n, v in evidence.items() if v.exposure is not None}
        return replace(result, exposure=exposure)

    def _outlook(self, number: int) -> Outlook:
        motion, searching = copy.copy(self._motion), self._start is not None
        return Outlook(number, self.rig, self.body, motion, self._body.limits, searching)

    def _search_room(self, start: Starter, seen: Seen) -> Found | None:
        """Search for a person in the whole views; None if there is none."""
        if self._body.may_be_anothers(self._motion.since_s(seen.stamp_ns)):
            self._body.reset()
            self._start = start = self._new_start()
        if not anybody(seen.used):
            start.reset()
            return None
        found = start.step(seen.used, seen.stamp_ns, late=self._effort.late)
        if found is None:
            return None
        self._searcher = self._searchers.near(found.searcher.body)
        self._body.take_found(found.searcher.body, settled=found.settled)
        search = self._searcher.frame(found.observations, seen.stamp_ns, found.pose)
        if found.settled:
            self._start = None
            search.run(frame_stages(self.body, self.config, found.pose, self.body.sigma))
        return Found(
            search, seen.stamp_ns, found.observations, seen.notes + found.notes,
            restarted=True, settling=not found.settled, jumped=np.arange(self.body.size),
        )  # fmt: skip

    def _search_near(self, predicted: FloatArray, seen: Seen) -> Found | None:
        """Search near a predicted pose (p,); None if there is no person."""
        used, stamp_ns = seen.used, seen.stamp_ns
        if not anybody(used):
            return None
        if self._body.awaits_first_frame:
            at, fit = self._motion.pose, self._body.fit_first_frame
            if (start := fit(self._searchers.near, used, stamp_ns, at)) is None:
                return None
            predicted = start
            self._searcher = self._searchers.near(self.body)
        speeds = joint_speeds(self._searcher.body, self._motion.pose)
        limits = self._motion.reachable(stamp_ns, self._searcher.limits, speeds)
        search = self._searcher.frame(
            used, stamp_ns, predicted, limits=limits, radius_m=self._searcher.tracked_radius_m
        )
        sigma = self.body.sigma * self._motion.widening(stamp_ns)
        self._effort.search(search, self.body, self.config, predicted, sigma)
        recovered, effort = Recovered(search.pose), self._effort
        if self.config.refinement != "none" and self.config.search_again and effort.for_limbs:
            recovered = self._assessor.limbs.recover(
                self._searcher, search.contours, seen, search.pose,
                badly=effort.badly, late=effort.late, single=effort.reduced,
            )  # fmt: skip
        notes = seen.notes + self._body.take_warnings() + recovered.notes + seen.left_out
        jumped = recovered.jumped(self.body)
        corrected = self._motion.reachable(stamp_ns, limits, np.full_like(speeds, LIMB_RAD_S))
        search.take(recovered.placed(self.body, limits, corrected))
        return Found(
            search, stamp_ns, used, notes,
            rotated=recovered.rotated, jumped=jumped, recovered=recovered.moved_m > RECOVERED_M,
            searched=recovered.searched,
        )  # fmt: skip

    def _learn(self, found: Found, result: TrackResult) -> tuple[str, ...]:
        """Update what is known of motion, body and cameras with a frame; returns warnings."""
        search, tracked = found.search, self.state is TrackState.TRACKING
        self._motion.update(search.pose, found.stamp_ns, tracked=tracked, jumped=found.jumped)
        if not tracked or found.restarted or found.settling:
            return ()
        self._effort.tracked(search.cost)
        fit = self._body.fit_tracked_frame
        moved = fit(search, rotated=found.rotated, recovered=found.recovered)
        if moved is not None:
            self._searcher = self._searchers.near(self.body)
            self._motion.shift(moved, self._body.limits)
        if corrected := self._correction.add(
            result, self.body, search=search, late=self._effort.late, searched=found.searched
        ):
            self._searchers.rig = self._correction.rig
            self._body.cameras_changed(self._searchers.near)
            self._use_cameras(self._correction.rig)
        return corrected

    def _use_cameras(self, rig: CameraRig) -> None:
        """Use cameras as they are corrected from now on."""
        self.rig = self._searchers.rig = rig
        self.evidence.rig = self._views.rig = self._assessor.limbs.rig = rig
        self._searcher = self._searchers.near(self.body)

    def _new_start(self, last_pose: FloatArray | None = None) -> Starter:
        return Starter(
            self.rig, self.body, self._searchers.start, self.evidence.select,
            sized=self._body.sized, fit_shape=not self._body.sections_fitted,
            person=self._body.unfitted, last_pose=last_pose,
        )  # fmt: skip
