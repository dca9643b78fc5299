"""The one door: `Tracker.step` turns the views of one time into a pose."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import BodyModelError
from markerless_tracker.fitness.contour.frame import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Image, Region, Segmenter
from markerless_tracker.records import Confidence, Observation, TrackResult, TrackState
from markerless_tracker.tracking.confidence import confidence_of
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.gather import EvidenceMaker
from markerless_tracker.tracking.evidence.views import ViewWatch, anybody
from markerless_tracker.tracking.limbs.watch import LimbWatch
from markerless_tracker.tracking.limits import joint_limits
from markerless_tracker.tracking.loss import Track, shared_overlap
from markerless_tracker.tracking.person.body_fitting import BodyFitting, Unmeasured
from markerless_tracker.tracking.person.first_frame import StartMarkers, shape_of_first_frame
from markerless_tracker.tracking.search import FrameSearch, Searcher
from markerless_tracker.tracking.smoothing import OneEuro
from markerless_tracker.tracking.stages import frame_stages
from markerless_tracker.tracking.start.starter import Starter

TRAINING_RATE_HZ = 60.0
"""The published spreads are changes between frames at this rate."""
LIMB_SPEED_M_S = 3.0
"""How fast a hand or foot may move against its prediction; it is looked for that far away."""


class Tracker:
    """Tracks one person, frame by frame, from a start pose or from where it finds somebody.

    Knows no clock, no ROS and no files: results depend on the arguments alone, and the same ones
    give the same bytes with any number of threads. Calls must come from one thread at a time.

    Args:
        rig: the cameras; views are named after them.
        body: the body with the person's sizes.
        config: every setting.
        start_pose: (p,) pose near which the first frame's search begins; None = look for
            somebody, which takes some frames.
        backgrounds: the empty scene per camera; cameras without one take ready-made observations
            only.
        shape_known: whether the body's sections are this person's; if not, and `fit_shape` is set,
            they are fitted to the first frame's silhouettes with the start pose held.
        start_markers: the markers that gave the start pose; noisy ones are settled on the first
            frame's silhouettes before the shape is fitted.
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
        self.rig = rig
        self.config = config
        self._person = person
        self._smooth = OneEuro(body) if config.smoothing == "one_euro" else None
        self._track = Track()
        self._views = ViewWatch(rig)
        self._limbs = LimbWatch(rig)
        self._recovers = config.search_again and config.refinement != "none"
        self._generic = body
        given = start_pose is not None
        self._start = np.array(body.neutral if start_pose is None else start_pose, np.float64)
        if self._start.shape != (body.size,) or not np.isfinite(self._start).all():
            raise BodyModelError(
                f"start pose has shape {self._start.shape}, body {body.name} expects "
                f"{body.size} finite numbers"
            )
        self._pose = self._start
        self._velocity_per_ns = np.zeros(body.size)
        self._stamp_ns: int | None = None
        self._threads = config.threads or os.cpu_count() or 1
        self._pool = ThreadPoolExecutor(max_workers=min(self._threads, len(rig)))
        self._evidence = EvidenceMaker(rig, config, backgrounds or {}, self._pool)
        self._fit_shape = config.fit_shape and not shape_known
        self._shape_fitted = not self._fit_shape
        self._start_markers = start_markers
        self._searcher = self._searcher_for(body)
        self._first_starter = None if given else Starter(
            rig, body, self._searcher_for, self._evidence.select,
            sized=None if person is None else person.sized, fit_shape=self._fit_shape,
        )  # fmt: skip
        self._starter = self._first_starter
        self._fitting = self._new_fitting()
        low, high = self._searcher.limits
        for name, value, a, b in zip(body.parameter_names, self._start, low, high, strict=True):
            if given and not a <= value <= b:
                raise BodyModelError(
                    f"start pose: {name} is {value:.4g}, its limits are {a:.4g} to {b:.4g}"
                )
        # Refuses a budget that cannot be spent before the first frame comes.
        frame_stages(body, config, self._pose, body.sigma)

    @property
    def state(self) -> TrackState:
        """State after the last step."""
        return self._track.state

    @property
    def body(self) -> BodyModel:
        """The tracked body; from the first frame on with the fitted sections."""
        return self._searcher.body

    def reset(self) -> None:
        """Forget the track: the next step searches around the start pose, or for somebody."""
        self._pose = self._start
        self._velocity_per_ns = np.zeros(self._generic.size)
        self._stamp_ns = None
        self._searcher.forget()
        self._track = Track()
        self._views.reset()
        self._limbs.reset()
        if self._smooth is not None:
            self._smooth.reset()
        self._starter = self._first_starter
        if self._starter is not None:
            self._starter.reset()
        if self._fit_shape:
            self._shape_fitted = False
            self._searcher = self._searcher_for(self._generic)
        self._fitting = self._new_fitting()

    def warm_up(self) -> None:
        """Compile every kernel, so that no later step waits for it; then `reset`."""
        blank: dict[str, Observation] = {}
        for camera in self.rig:
            width, height = camera.size_px
            nothing = np.zeros((height, width), dtype=np.uint8)
            segmenter = self._evidence.segmenters.get(camera.name)
            if segmenter is not None:
                channels = segmenter.background.channels
                shape = (height, width) if channels == 1 else (height, width, channels)
                segmenter.observe(np.zeros(shape, dtype=np.uint8), 0)
                segmenter.reset()
            nothing[height // 4 : height // 2, width // 4 : width // 2] = 1
            blank[camera.name] = Observation.from_mask(camera.name, 0, nothing, nothing)
        # The most work and the least: whether threads are woken depends on it.
        for views in (blank, dict(list(blank.items())[:1])):
            self._starter = None
            self.step(views, 0)
            self.reset()
        if self._fitting is not None:
            contours = self._searcher.frame(blank, 0, self._pose).contours
            self._fitting.warm_up(self.body, contours, self._pose)
            self.reset()

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Tell the person from other empty scenes from now on; then `warm_up`, which resets.

        Args:
            backgrounds: by camera; cameras without one take ready-made observations only.

        Raises:
            ImageError: a background does not fit its camera; all stays as it was.
        """
        self._evidence.take_backgrounds(backgrounds)
        self.warm_up()

    def regions(self, stamp_ns: int) -> dict[str, Region | None]:
        """Where in each camera's image `step` would look at a time; None for all of it.

        Each camera's turn to be looked at whole comes besides (`region.full_frame_every`).
        """
        margin_m = self._region_margin(stamp_ns)
        return self._evidence.regions(self.body, self._predict(stamp_ns), margin_m)

    def segmenter(self, camera: str) -> Segmenter | None:
        """What tells a camera's silhouettes from its background; None without one."""
        return self._evidence.segmenters.get(camera)

    def step(self, views: Mapping[str, Image | Observation], stamp_ns: int) -> TrackResult:
        """Find the pose that explains the views of one time.

        Args:
            views: camera name to its image (as `Segmenter.observe` takes it) or to a ready-made
                observation; cameras may be missing.
            stamp_ns: time of the images; the search widens with the time since the last step.

        Raises:
            ImageError, CalibrationError: no view, one of an unknown camera, or one that does not
                fit its calibration or background; names the camera.
        """
        result = self._step(views, stamp_ns)
        return replace(result, exposure=self._evidence.exposure(views))

    def _step(self, views: Mapping[str, Image | Observation], stamp_ns: int) -> TrackResult:
        predicted = self._predict(stamp_ns)
        if self._starter is not None:
            observed = self._evidence.observe(views, stamp_ns)
            believed, notes = self._views.sort(observed, self.body, None)
            if not anybody(believed):
                return self._unseen(observed, stamp_ns, notes)
            return self._seek(self._starter, believed, stamp_ns, notes)
        observed, warnings = self._evidence.gather(
            views, stamp_ns, self.body, predicted, margin_m=self._region_margin(stamp_ns)
        )
        expected = predicted if self.state is TrackState.TRACKING else None
        observations, notes = self._views.sort(observed, self.body, expected)
        if not anybody(observations):
            return self._unseen(observed, stamp_ns, notes)
        if not self._shape_fitted:
            self._shape_fitted = True
            predicted = self._take_shape(observations, stamp_ns)
        search = self._searcher.frame(observations, stamp_ns, predicted)
        sigma = self.body.sigma * self._rate_factor(stamp_ns)
        search.run(frame_stages(self.body, self.config, predicted, sigma))
        elsewhere: tuple[str, ...] = ()
        if self._recovers:
            search.pose, elsewhere = self._limbs.recover(
                self._searcher, search.contours, observations, stamp_ns, search.pose
            )
            notes += tuple(f"{name}: found elsewhere" for name in elsewhere)
        result = self._conclude(search, stamp_ns, observations, notes + warnings)
        # A limb found elsewhere has not moved there.
        for name in elsewhere:
            self._velocity_per_ns[self.body.subspaces[name]] = 0.0
        if self._fitting is not None and self.state is TrackState.TRACKING:
            self._fit_body(self._fitting, search)
        if self.config.search_again and self._track.given_up(stamp_ns):
            self._look_again()
        return result

    def _unseen(
        self, observed: Mapping[str, Observation], stamp_ns: int, notes: tuple[str, ...]
    ) -> TrackResult:
        """Nobody, in any view that can be believed."""
        if self._starter is not None:
            self._starter.reset()
        if self._starter is not None or self.state is TrackState.SEARCHING:
            return self._nobody(observed, stamp_ns, notes)
        self._track.note(0.0, stamp_ns)
        self._velocity_per_ns = np.zeros(self.body.size)
        if self.config.search_again and self._track.given_up(stamp_ns):
            self._look_again()
        return self._without_pose(observed, stamp_ns, notes)

    def _look_again(self) -> None:
        """From the next step on look for the body that was lost."""
        if self._smooth is not None:
            self._smooth.reset()
        self._starter = Starter(
            self.rig, self.body, self._searcher_for, self._evidence.select,
            fit_shape=False, last_pose=self._pose,
        )  # fmt: skip

    def _nobody(
        self, observed: Mapping[str, Observation], stamp_ns: int, notes: tuple[str, ...]
    ) -> TrackResult:
        self._track = Track()
        return self._without_pose(observed, stamp_ns, notes)

    def _without_pose(
        self, observed: Mapping[str, Observation], stamp_ns: int, notes: tuple[str, ...]
    ) -> TrackResult:
        return TrackResult(
            stamp_ns=stamp_ns, state=self.state, pose=None, markers_m=None,
            fitness=float("nan"), evaluations=0, observations=observed, warnings=notes,
            iou=dict.fromkeys(observed, 0.0) if self.state is TrackState.LOST else {},
        )  # fmt: skip

    def _seek(
        self,
        starter: Starter,
        observed: Mapping[str, Observation],
        stamp_ns: int,
        notes: tuple[str, ...],
    ) -> TrackResult:
        """Look for somebody; no pose if nobody is there."""
        found = starter.step(observed, stamp_ns)
        if found is None:
            return self._nobody(observed, stamp_ns, notes)
        if self._smooth is not None:
            # A person turned round, or found elsewhere, has not moved there.
            self._smooth.reset()
        self._searcher = found.searcher
        search = self._searcher.frame(found.observations, stamp_ns, found.pose)
        if found.settled:
            self._starter, self._shape_fitted = None, True
            search.run(frame_stages(self.body, self.config, found.pose, self.body.sigma))
        result = self._conclude(search, stamp_ns, found.observations, notes + found.notes)
        # Poses of a search jump, that is no motion.
        self._velocity_per_ns = np.zeros(self.body.size)
        return result

    def _take_shape(self, observations: Mapping[str, Observation], stamp_ns: int) -> FloatArray:
        """Fit the body's sections to the first frame; returns the start pose (p,) to go on from."""

        def contours(body: BodyModel, pose: FloatArray) -> ContourFrame:
            return self._searcher_for(body).frame(observations, stamp_ns, pose).contours

        body, pose = shape_of_first_frame(
            self._generic,
            self._pose,
            self._start_markers,
            contours,
            self.config,
            self._searcher.limits,
        )
        self._searcher = self._searcher_for(body)
        return pose

    def _new_fitting(self) -> BodyFitting | None:
        if self._person is None or not (self._fit_shape and self.config.fit_lengths):
            return None
        return BodyFitting(self._person, self._searcher.limits)

    def _fit_body(self, fitting: BodyFitting, search: FrameSearch) -> None:
        """Take a tracked frame for the fit of lengths and sections; go on with what they become."""
        fitted = fitting.add(self.body, search.contours, search.pose)
        if fitted is None:
            return
        self._fitting = None
        self._searcher = self._searcher_for(fitted.body)
        self._pose = np.clip(self._pose + fitted.moved, *self._searcher.limits)

    def _conclude(
        self,
        search: FrameSearch,
        stamp_ns: int,
        observations: Mapping[str, Observation],
        warnings: tuple[str, ...],
    ) -> TrackResult:
        terms = search.terms()
        self._track.note(shared_overlap(terms.values()), stamp_ns)
        elapsed_ns = stamp_ns - self._stamp_ns if self._stamp_ns is not None else 0
        moving = elapsed_ns > 0 and self.state is TrackState.TRACKING
        change = search.pose - self._pose
        self._velocity_per_ns = change / elapsed_ns if moving else np.zeros(change.size)
        self._pose = search.pose
        self._stamp_ns = stamp_ns
        lost = self._limbs.lost
        limbs = self._limbs.judge(self.body, search.pose, observations, search.particle_sd_ratio)
        warnings += tuple(f"{name}: lost" for name in self._limbs.lost if name not in lost)
        shown = search.pose
        if self._smooth is not None:
            shown = np.clip(self._smooth(shown, stamp_ns), *self._searcher.limits)
        return TrackResult(
            stamp_ns=stamp_ns,
            state=self.state,
            pose=shown,
            markers_m=markers(self.body, shown),
            fitness=float(np.mean([t.silhouette + t.edges for t in terms.values()])),
            iou={name: t.overlap for name, t in terms.items()},
            evaluations=search.evaluations,
            refinements=search.refinements,
            observations=observations,
            warnings=warnings,
            confidence=self._confidence(search),
            limbs=limbs,
        )

    def _confidence(self, search: FrameSearch) -> Confidence | None:
        if self.config.refinement == "none":
            return None
        return confidence_of(self.body, search.pose, search.contours, measured=self.body.measured)

    def _predict(self, stamp_ns: int) -> FloatArray:
        """The pose (p,) expected at a time: the last one moved on, with damped velocity."""
        if self._stamp_ns is None or stamp_ns <= self._stamp_ns:
            return self._pose
        elapsed_ns = min(
            stamp_ns - self._stamp_ns, self.config.sigma.rate_max / TRAINING_RATE_HZ * 1e9
        )
        moved = self._pose + self.config.prediction * elapsed_ns * self._velocity_per_ns
        return np.asarray(np.clip(moved, *self._searcher.limits))

    def _region_margin(self, stamp_ns: int) -> float | None:
        """How far around the predicted body to look, m; None for the whole images."""
        if (
            self.state is not TrackState.TRACKING
            or self._stamp_ns is None
            or stamp_ns <= self._stamp_ns
        ):
            return None
        elapsed_s = (stamp_ns - self._stamp_ns) * 1e-9
        return self.config.region.margin_m + LIMB_SPEED_M_S * elapsed_s

    def _rate_factor(self, stamp_ns: int) -> float:
        """How much wider than at the training rate to search, by the time since the last step."""
        if self._stamp_ns is None or stamp_ns <= self._stamp_ns:
            return 1.0
        frames = (stamp_ns - self._stamp_ns) * 1e-9 * TRAINING_RATE_HZ
        return min(frames, self.config.sigma.rate_max)

    def _searcher_for(self, body: BodyModel) -> Searcher:
        return Searcher(
            self.rig,
            body,
            self.config,
            limits=joint_limits(body, self.config),
            threads=self._threads,
            mapper=self._pool.map,
        )
