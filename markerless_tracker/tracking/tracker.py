"""The one door: `Tracker.step` turns the views of one time into a pose."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from markerless_tracker.body import BodyModel, Feasibility, markers
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import BodyModelError, ImageError
from markerless_tracker.fitness import Fitness
from markerless_tracker.fitness.arrays import Views
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Image, Segmenter
from markerless_tracker.optim import Problem, Sppso, keyed_generator
from markerless_tracker.records import Observation, Stage, TrackResult, TrackState
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.loss import next_state
from markerless_tracker.tracking.selection import explained_part
from markerless_tracker.tracking.stages import STAGES

TRAINING_RATE_HZ = 60.0
"""The published spreads are changes between frames at this rate."""


class Tracker:
    """Tracks one person, frame by frame, from a start pose.

    Knows no clock, no ROS and no files: results depend on the arguments alone, and the same ones
    give the same bytes with any number of threads. Calls must come from one thread at a time.

    Args:
        rig: the cameras; views are named after them.
        body: the body with the person's sizes.
        config: every setting.
        start_pose: (p,) pose near which the first frame's search begins.
        backgrounds: the empty scene per camera; cameras without one take ready-made observations
            only.

    Raises:
        BodyModelError: the start pose has another size or breaks the joint limits.
    """

    def __init__(
        self,
        rig: CameraRig,
        body: BodyModel,
        config: TrackerConfig,
        *,
        start_pose: FloatArray,
        backgrounds: Mapping[str, BackgroundModel] | None = None,
    ) -> None:
        self.rig = rig
        self.body = body
        self.config = config
        self.state = TrackState.SEARCHING
        self._limits = body.walking_limits if config.limits == "bt_walking" else body.limits
        self._start = np.array(start_pose, dtype=np.float64)
        if self._start.shape != (body.size,) or not np.isfinite(self._start).all():
            raise BodyModelError(
                f"start pose has shape {self._start.shape}, "
                f"body {body.name} expects {body.size} numbers"
            )
        self._pose = self._start
        self._stamp_ns: int | None = None
        self._threads = config.threads or os.cpu_count() or 1
        self._pool = ThreadPoolExecutor(max_workers=min(self._threads, len(rig)))
        self._feasible = Feasibility(body, self._limits, config.collision)
        self._fitness = Fitness(
            body,
            rig.cameras,
            threads=self._threads,
            edge_rule=config.edge_rule,
            edge_term=config.edge_term,
            edge_spacing_px=config.edge_spacing_px,
            edge_step_px=config.edge_step_px,
        )
        self._segmenters = {
            camera.name: self._segmenter(camera.name, backgrounds[camera.name])
            for camera in rig
            if backgrounds and camera.name in backgrounds
        }
        # Refuses a budget that cannot be spent before the first frame comes.
        STAGES[config.optimizer](body, config, self._pose, body.sigma)

    def reset(self) -> None:
        """Forget the track: the next step searches around the start pose again."""
        self._pose = self._start
        self._stamp_ns = None
        self.state = TrackState.SEARCHING

    def warm_up(self) -> None:
        """Compile every kernel, so that no later step waits for it. The track is not touched."""
        blank = {
            camera.name: Observation.from_mask(
                camera.name,
                0,
                np.zeros(camera.size_px[::-1], dtype=np.uint8),
                np.zeros(camera.size_px[::-1], dtype=np.uint8),
            )
            for camera in self.rig
        }
        for name, segmenter in self._segmenters.items():
            width, height = self.rig[name].size_px
            channels = segmenter.background.channels
            shape = (height, width) if channels == 1 else (height, width, channels)
            segmenter.observe(np.zeros(shape, dtype=np.uint8), 0)
        pose, stamp, state = self._pose, self._stamp_ns, self.state
        self.step(blank, 0)
        self._pose, self._stamp_ns, self.state = pose, stamp, state

    def step(self, views: Mapping[str, Image | Observation], stamp_ns: int) -> TrackResult:
        """Find the pose that explains the views of one time.

        Args:
            views: camera name to its image (as `Segmenter.observe` takes it) or to a ready-made
                observation; cameras may be missing.
            stamp_ns: time of the images; the search widens with the time since the last step.

        Raises:
            ImageError: no view, one of an unknown camera, or one that does not fit its
                calibration or background; names the camera.
        """
        observed = self._observe(views, stamp_ns)
        observations, warnings = self._select(observed)
        laid_out = self._fitness.lay_out(observations)

        pose = self._pose
        evaluations = 0
        sigma = self.body.sigma * self.config.sigma_scale * self._rate_factor(stamp_ns)
        for stage in STAGES[self.config.optimizer](self.body, self.config, pose, sigma):
            stage = replace(stage, centre=pose)
            pose, spent = self._search(stage, laid_out, stamp_ns)
            evaluations += spent

        terms = self._fitness.terms(laid_out, pose)
        overlap = float(np.mean([t.overlap for t in terms.values()]))
        self.state = next_state(self.state, overlap)
        self._pose = pose
        self._stamp_ns = stamp_ns
        return TrackResult(
            stamp_ns=stamp_ns,
            state=self.state,
            pose=pose,
            markers_m=markers(self.body, pose),
            fitness=float(np.mean([t.silhouette + t.edges for t in terms.values()])),
            agreement={name: t.overlap for name, t in terms.items()},
            evaluations=evaluations,
            observations=observations,
            warnings=warnings,
        )

    def _segmenter(self, name: str, background: BackgroundModel) -> Segmenter:
        size = self.rig[name].size_px
        if background.size_px != size:
            raise ImageError(
                f"{name}: background of {background.size_px[0]}x{background.size_px[1]} px, "
                f"its calibration says {size[0]}x{size[1]}"
            )
        return Segmenter(name, background, self.config)

    def _observe(
        self, views: Mapping[str, Image | Observation], stamp_ns: int
    ) -> dict[str, Observation]:
        if not views:
            raise ImageError(f"no view came, expected some of {', '.join(self.rig.names)}")
        for name in views:
            self.rig[name]

        def evidence(item: tuple[str, Image | Observation]) -> Observation:
            name, view = item
            if isinstance(view, Observation):
                return view
            if name not in self._segmenters:
                raise ImageError(
                    f"{name}: an image came, but no background to tell the person from"
                )
            return self._segmenters[name].observe(view, stamp_ns)

        return dict(zip(views, self._pool.map(evidence, views.items()), strict=True))

    def _select(
        self, observed: Mapping[str, Observation]
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """Keep the components that the predicted body explains; say what was left out."""
        margin = self.config.component_margin_px

        def part(item: tuple[str, Observation]) -> tuple[Observation, int]:
            return explained_part(item[1], self.rig[item[0]], self.body, self._pose, margin)

        parts = dict(zip(observed, self._pool.map(part, observed.items()), strict=True))
        warnings = tuple(
            f"{name}: {left_out} px of silhouette away from the body left out"
            for name, (_, left_out) in parts.items()
            if left_out
        )
        return {name: kept for name, (kept, _) in parts.items()}, warnings

    def _rate_factor(self, stamp_ns: int) -> float:
        """How much wider than at the training rate to search, by the time since the last step."""
        if self._stamp_ns is None or stamp_ns <= self._stamp_ns:
            return 1.0
        frames = (stamp_ns - self._stamp_ns) * 1e-9 * TRAINING_RATE_HZ
        return min(frames, self.config.sigma_rate_max)

    def _search(self, stage: Stage, views: Views, stamp_ns: int) -> tuple[FloatArray, int]:
        """Run one stage; returns the best pose (p,) and the evaluations spent."""
        evaluator = self._fitness.prepare(views, stage)
        problem = Problem(
            bounds=self._limits[:, stage.active],
            centre=stage.centre[stage.active],
            sigma=stage.sigma[stage.active],
            particles=stage.particles,
            iterations=stage.iterations,
            feasible=lambda points: self._feasible(evaluator.poses(points)),
            rng=keyed_generator(self.config.seed, stamp_ns, stage.name),
        )
        optimizer = Sppso(problem, update=self.config.update)
        best = optimizer.run(evaluator)
        return evaluator.poses(best[None])[0], optimizer.evaluations
