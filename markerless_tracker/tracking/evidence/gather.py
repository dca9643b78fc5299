"""The views of one time to the evidence of the tracked body, cameras side by side."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ImageError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Image, Region, Segmenter, edge_radius_px
from markerless_tracker.records import Observation
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.selection import (
    BodyLines,
    body_lines,
    body_region,
    explained_in_region,
    explained_part,
    place_cones,
)


class EvidenceMaker:
    """Makes observations of views, and keeps of their silhouettes what the prediction explains.

    Args:
        rig: the cameras.
        config: settings of the imaging and the selection.
        backgrounds: the empty scene per camera; cameras without one take observations only.
        pool: threads that the cameras share.

    Raises:
        ImageError: a background does not fit its camera.
    """

    def __init__(
        self,
        rig: CameraRig,
        config: TrackerConfig,
        backgrounds: Mapping[str, BackgroundModel],
        pool: ThreadPoolExecutor,
    ) -> None:
        self._rig = rig
        self._config = config
        self._margin_px = config.region.component_margin_px
        self._clear_px = edge_radius_px(config) + config.region.component_margin_px
        self._every = config.region.full_frame_every
        self._calls = 0
        self._pool = pool
        self.segmenters: dict[str, Segmenter] = {}
        self.take_backgrounds(backgrounds)

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use other backgrounds from now on.

        Raises:
            ImageError: a background does not fit its camera; all stays as it was.
        """
        segmenters: dict[str, Segmenter] = {}
        for camera in self._rig:
            background = backgrounds.get(camera.name)
            if background is None:
                continue
            if background.size_px != camera.size_px:
                raise ImageError(
                    f"{camera.name}: background of {background.size_px[0]}x"
                    f"{background.size_px[1]} px, its calibration says "
                    f"{camera.size_px[0]}x{camera.size_px[1]}"
                )
            segmenters[camera.name] = Segmenter(
                camera.name, background, self._config, edges=self._config.edge_weight > 0.0
            )
        self.segmenters = segmenters

    def observe(
        self, views: Mapping[str, Image | Observation], stamp_ns: int
    ) -> dict[str, Observation]:
        """Observations of the whole views, as they are; ready-made ones pass.

        Raises:
            ImageError, CalibrationError: no view, an unknown camera, an image without a background
                or one that does not fit; names the camera.
        """
        self._check(views)

        def evidence(item: tuple[str, Image | Observation]) -> Observation:
            name, view = item
            if isinstance(view, Observation):
                return view
            return self._segmenter(name).observe(view, stamp_ns)

        return dict(zip(views, self._pool.map(evidence, views.items()), strict=True))

    def warm_up(self) -> dict[str, Observation]:
        """Compile the imaging; returns made-up observations with a rectangle as silhouette."""
        made_up = {}
        for camera in self._rig:
            width, height = camera.size_px
            segmenter = self.segmenters.get(camera.name)
            if segmenter is not None:
                channels = segmenter.background.channels
                shape = (height, width) if channels == 1 else (height, width, channels)
                segmenter.observe(np.zeros(shape, dtype=np.uint8), 0)
                segmenter.reset()
            mask = np.zeros((height, width), dtype=np.uint8)
            mask[height // 4 : height // 2, width // 4 : width // 2] = 1
            made_up[camera.name] = Observation.from_mask(camera.name, 0, mask, mask)
        return made_up

    def select(
        self, observed: Mapping[str, Observation], body: BodyModel, predicted: FloatArray
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """Keep the components that a predicted pose (p,) explains; say what was left out."""
        cones = place_cones(body, predicted)

        def part(item: tuple[str, Observation]) -> tuple[Observation, int]:
            name, observation = item
            return explained_part(observation, body_lines(self._rig[name], cones), self._margin_px)

        return _kept(dict(zip(observed, self._pool.map(part, observed.items()), strict=True)))

    def gather(
        self,
        views: Mapping[str, Image | Observation],
        stamp_ns: int,
        body: BodyModel,
        predicted: FloatArray,
        *,
        margin_m: float | None,
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """As `observe` and then `select`, in less time while the body is tracked.

        With a margin around the body at the predicted pose, only that region is processed,
        except where that would change what stays, and each camera's whole frame every
        `region.full_frame_every` calls.

        Raises:
            ImageError, CalibrationError: as `observe`.
        """
        self._check(views)
        self._calls += 1
        cones = place_cones(body, predicted)

        def evidence(item: tuple[str, Image | Observation]) -> tuple[Observation, int]:
            name, view = item
            lines = body_lines(self._rig[name], cones)
            if not isinstance(view, Observation):
                segmenter = self._segmenter(name)
                region = None
                if not self._whole_frame_is_due(name):
                    region = self._region(lines, margin_m)
                if region is not None:
                    seen = segmenter.observe(view, stamp_ns, region)
                    found = explained_in_region(seen, lines, self._margin_px, self._clear_px)
                    if found is not None:
                        return found
                view = segmenter.observe(view, stamp_ns)
            return explained_part(view, lines, self._margin_px)

        return _kept(dict(zip(views, self._pool.map(evidence, views.items()), strict=True)))

    def regions(
        self, body: BodyModel, predicted: FloatArray, margin_m: float | None
    ) -> dict[str, Region | None]:
        """Region of each camera: a body at a pose (p,) and a margin around it; None = all."""
        cones = place_cones(body, predicted)
        return {
            camera.name: self._region(body_lines(camera, cones), margin_m) for camera in self._rig
        }

    def _region(self, lines: BodyLines, margin_m: float | None) -> Region | None:
        return None if margin_m is None else body_region(lines, margin_m, self._clear_px)

    def exposure(self, views: Mapping[str, Image | Observation]) -> dict[str, tuple[float, ...]]:
        """How bright the images just gathered are beside their backgrounds, by channel."""
        return {
            name: self.segmenters[name].gain
            for name, view in views.items()
            if not isinstance(view, Observation)
        }

    def _whole_frame_is_due(self, name: str) -> bool:
        """The cameras in rotation, so that no frame costs much more than others."""
        shift = self._rig.names.index(name) * self._every // len(self._rig)
        return (self._calls + shift) % self._every == 0

    def _check(self, views: Mapping[str, Image | Observation]) -> None:
        if not views:
            raise ImageError(f"no view came, expected some of {', '.join(self._rig.names)}")
        for name in views:
            self._rig[name]

    def _segmenter(self, name: str) -> Segmenter:
        if name not in self.segmenters:
            raise ImageError(f"{name}: an image came, but no background to tell the person from")
        return self.segmenters[name]


def _kept(
    parts: Mapping[str, tuple[Observation, int]],
) -> tuple[dict[str, Observation], tuple[str, ...]]:
    """What is kept of each view, and a line for each of which something was left out."""
    warnings = tuple(
        f"{name}: {left_out} px of silhouette away from the body left out"
        for name, (_, left_out) in parts.items()
        if left_out
    )
    return {name: kept for name, (kept, _) in parts.items()}, warnings
