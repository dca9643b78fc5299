"""Makes the evidence of the tracked body from the views of one time, cameras in parallel."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ImageError
from markerless_tracker.fitness.threads import mapper as mapper_of
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Image, Region, Segmenter, edge_radius_px
from markerless_tracker.libraries import usable_cores
from markerless_tracker.records import Observation
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.evidence.prepared import Outlook, SeenView, Views
from markerless_tracker.tracking.evidence.segmenting import SegmentingProcess
from markerless_tracker.tracking.evidence.selection import (
    BodyLines,
    body_lines,
    body_region,
    explained_in_region,
    explained_part,
    place_cones,
)
from markerless_tracker.tracking.processes.child import SharedMemory

WIDE_MARGIN_M = 0.5
"""Margin around the predicted body of the second region, used if the first cuts the person off."""
_REPORTED_PX = 16
"""Fewer pixels that are left out are specks of noise and give no warning."""


class EvidenceMaker:
    """Makes observations of views, and keeps the parts of silhouettes that the prediction explains.

    Args:
        rig: the cameras; an attribute, which may be replaced between steps.
        config: settings of the imaging and the selection.
        backgrounds: the empty scene per camera; cameras without one take observations only.
        mapper: `map`, or one that uses threads; applied to the cameras. Images that a step segments
            before its fit use all threads.

    Raises:
        ImageError: a background does not fit its camera.
    """

    def __init__(
        self,
        rig: CameraRig,
        config: TrackerConfig,
        backgrounds: Mapping[str, BackgroundModel],
        mapper: Callable[..., Iterable[Any]],
    ) -> None:
        self.rig = rig
        self._config = config
        self._margin_px = config.region.component_margin_px
        self._clear_px = edge_radius_px(config) + config.region.component_margin_px
        self._every = config.region.full_frame_every
        self._follows = config.background.follow_s > 0.0
        self._three_classes = config.shadow.undecided
        self._mapper = mapper
        self._threads = config.threads or usable_cores()
        self._image_mapper = mapper_of(min(self._threads, len(rig)))
        self._process: SegmentingProcess | None = None
        self._ahead = False
        self._shared: SharedMemory | None = None
        self.segmenters: dict[str, Segmenter] = {}
        self.take_backgrounds(backgrounds)

    def take_backgrounds(self, backgrounds: Mapping[str, BackgroundModel]) -> None:
        """Use other backgrounds from now on.

        Raises:
            ImageError: a background does not fit its camera; nothing has changed then.
        """
        segmenters: dict[str, Segmenter] = {}
        for camera in self.rig:
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
        self._backgrounds = dict(backgrounds)
        if self._ahead:
            self.start_process(self._shared)

    def segment(
        self,
        views: Views,
        stamp_ns: int,
        outlook: Outlook,
        *,
        ahead: bool = False,
    ) -> dict[str, SeenView]:
        """The views segmented in the regions that follow from an outlook.

        A ready-made observation of a whole frame is treated like its image: its components are
        selected in the same regions. An observation of a part of the frame is used as it is.

        Args:
            views: camera name to image or observation.
            stamp_ns: their time.
            outlook: of the set before the last one.
            ahead: whether this runs beside a step: in this thread or the segmenting process, one
                camera after the other.

        Raises:
            ImageError, CalibrationError: no view, an unknown camera, an image without a background
                or one that does not fit; names the camera.
        """
        self._check(views)
        # Sums over the views must not depend on the caller's order.
        views = {name: views[name] for name in self.rig.names if name in views}
        regions = self.regions(outlook, stamp_ns)
        made: dict[str, SeenView] = {}
        if ahead and self._process is not None:
            images = {n: v for n, v in views.items() if not isinstance(v, Observation)}
            for name, image in images.items():
                self._segmenter(name).check(image)
            made = self._process.segment(images, stamp_ns, regions) or {}

        def one(name: str) -> SeenView:
            view = views[name]
            if isinstance(view, Observation):
                region = regions[name] if view.is_whole else None
                return SeenView(view, None, region, view.exposure)
            if name in made:
                return made[name]
            return self._segmented(name, view, stamp_ns, regions[name], outlook.number)

        each: Callable[..., Iterable[SeenView]] = map if ahead else self._image_mapper
        return dict(zip(views, each(one, views), strict=True))

    def segment_regions(
        self,
        images: Mapping[str, Image],
        stamp_ns: int,
        regions: Mapping[str, Region | None],
    ) -> dict[str, SeenView]:
        """Images segmented in given regions (None = whole image), one after the other.

        Raises:
            ImageError: an image without a background or one that does not fit; names the camera.
        """
        return {n: self._segmented(n, v, stamp_ns, regions[n], 0) for n, v in images.items()}

    def start_process(self, shared: SharedMemory | None = None) -> None:
        """Start a process that segments sets ahead of their step; `warm_up` gives it backgrounds.

        Without effect with one thread, or if the backgrounds follow the images, which must then be
        segmented in the order of the steps. Without backgrounds it starts when they are given.

        Args:
            shared: memory that holds the images; None for memory of its own.
        """
        self._ahead, self._shared = True, shared
        if self._threads > 1 and self.segmenters and not self._follows and self._process is None:
            self._process = SegmentingProcess(self.rig, shared)

    def take_notes(self) -> tuple[str, ...]:
        """A line, told once, if the segmenting process cannot segment any more."""
        fault = None if self._process is None else self._process.take_fault()
        if fault is None:
            return ()
        return (f"{fault}; images are segmented in the tracker's own process",)

    @property
    def process_cpu_s(self) -> float:
        """CPU time of the segmenting process; 0 without one."""
        return 0.0 if self._process is None else self._process.cpu_s

    def finish_compiling(self) -> None:
        """Compile the imaging, and wait until the segmenting process has done so, too."""
        if self._process is not None:
            self._process.wait()
        for segmenter in self.segmenters.values():
            segmenter.warm_up()

    def close(self) -> None:
        """End the segmenting process, if there is one."""
        process, self._process, self._ahead = self._process, None, False
        if process is not None:
            process.close()

    def whole(self, seen: Mapping[str, SeenView], stamp_ns: int) -> dict[str, Observation]:
        """Observations of the whole views, without selection of components."""
        found = self._image_mapper(lambda name: self._whole(name, seen[name], stamp_ns), seen)
        return dict(zip(seen, found, strict=True))

    def _segmented(
        self, name: str, image: Image, stamp_ns: int, region: Region | None, number: int
    ) -> SeenView:
        segmenter = self._segmenter(name)
        # A background that follows the images learns from whole images.
        part = None if self._whole_frame_is_due(name, number) else region
        with segmenter.lock:
            observation = segmenter.observe(image, stamp_ns, part)
            return SeenView(observation, image, region, segmenter.gain)

    def _whole(self, name: str, seen: SeenView, stamp_ns: int) -> Observation:
        observation = seen.observation
        if seen.image is None or observation.is_whole:
            return observation
        segmenter = self._segmenter(name)
        with segmenter.lock:
            return segmenter.observe(seen.image, stamp_ns)

    def _whole_frame_is_due(self, name: str, number: int) -> bool:
        """Whether a camera's whole image is due; in rotation, so that frames take equally long."""
        shift = self.rig.names.index(name) * self._every // len(self.rig)
        return self._follows and (number + shift) % self._every == 0

    def start_compiling(self) -> None:
        """Let the segmenting process compile the imaging, if there is one."""
        if self._process is not None:
            self._process.use(self._config, self._backgrounds)

    def made_up(self) -> dict[str, Observation]:
        """Made-up observations, to compile with.

        All but the first are of regions, as when the body is tracked. The silhouette is a rectangle
        and a pixel in the corner. Pixels beside and below the rectangle are undecided.
        """
        made_up: dict[str, Observation] = {}
        for camera in self.rig:
            width, height = camera.size_px
            mask = np.zeros((height, width), dtype=np.uint8)
            mask[height // 4 : height // 2, width // 4 : width // 2] = 1
            mask[0, 0] = 1
            around = mask == 0
            around[: height // 4] = False
            left, right = width // 8, width - width // 8
            whole = Observation.from_mask(
                camera.name, 0, mask, mask, undecided=around if self._three_classes else None
            )
            made_up[camera.name] = whole.cut((left, 0, right, height)) if made_up else whole
        return made_up

    def select(
        self, observed: Mapping[str, Observation], body: BodyModel, predicted: FloatArray
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """Keep the components that a predicted pose (p,) explains; return warnings, too."""
        cones = place_cones(body, predicted)

        def part(item: tuple[str, Observation]) -> tuple[Observation, int]:
            name, observation = item
            return explained_part(observation, body_lines(self.rig[name], cones), self._margin_px)

        return _kept(dict(zip(observed, self._mapper(part, observed.items()), strict=True)))

    def gather(
        self,
        seen: Mapping[str, SeenView],
        stamp_ns: int,
        body: BodyModel,
        predicted: FloatArray,
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """As `select` of `whole`, but cut to a region around the body, which takes less time.

        A component that is connected to the body outside of the region only is left out. If a
        region cuts the person off, a wider region is segmented. If that cuts the person off, too,
        the whole frame is segmented.

        Args:
            seen: returned by `segment`.
            stamp_ns: time of the views.
            body: the tracked body.
            predicted: (p,) pose expected at that time.
        """
        cones = place_cones(body, predicted)

        def evidence(name: str) -> tuple[Observation, int]:
            lines, view = body_lines(self.rig[name], cones), seen[name]
            for part in self._parts(name, view, stamp_ns, lines):
                found = explained_in_region(part, lines, self._margin_px, self._clear_px)
                if found is not None:
                    return found
            return explained_part(self._whole(name, view, stamp_ns), lines, self._margin_px)

        return _kept(dict(zip(seen, self._mapper(evidence, seen), strict=True)))

    def _parts(
        self, name: str, view: SeenView, stamp_ns: int, lines: BodyLines
    ) -> Iterator[Observation]:
        """The view in its region, then in a wider one, which is segmented when it is requested.

        Inside of a region the evidence is the same as that of the whole image
        (`Segmenter.observe`), so ready-made evidence is cut to the region.
        """
        if view.region is None:
            return
        yield view.observation.cut(view.region)
        wide = body_region(lines, WIDE_MARGIN_M, self._clear_px)
        if wide is None:
            return
        if view.image is None:
            yield view.observation.cut(wide)
            return
        segmenter = self._segmenter(name)
        with segmenter.lock:
            yield segmenter.observe(view.image, stamp_ns, wide)

    def regions(self, outlook: Outlook, stamp_ns: int) -> dict[str, Region | None]:
        """Region of each camera, None = whole frame; arguments as for `segment`."""
        predicted, margin_m = outlook.predicted(stamp_ns)
        if margin_m is None or self._every == 1:
            return dict.fromkeys(outlook.rig.names)
        cones = place_cones(outlook.body, predicted)
        return {
            camera.name: body_region(body_lines(camera, cones), margin_m, self._clear_px)
            for camera in outlook.rig
        }

    def _check(self, views: Views) -> None:
        if not views:
            raise ImageError(f"no view came, expected some of {', '.join(self.rig.names)}")
        for name, view in views.items():
            expected = self.rig[name].size_px
            if isinstance(view, Observation) and view.size_px != expected:
                raise ImageError(
                    f"{name}: observation of a {view.size_px[0]}x{view.size_px[1]} px frame, "
                    f"its calibration says {expected[0]}x{expected[1]} px"
                )

    def _segmenter(self, name: str) -> Segmenter:
        if name not in self.segmenters:
            raise ImageError(f"{name}: an image came, but no background to tell the person from")
        return self.segmenters[name]


def _kept(
    parts: Mapping[str, tuple[Observation, int]],
) -> tuple[dict[str, Observation], tuple[str, ...]]:
    """What is kept of each view, and a warning for each view that lost more than specks."""
    warnings = tuple(
        f"{name}: {left_out} px of silhouette away from the body left out"
        for name, (_, left_out) in parts.items()
        if left_out >= _REPORTED_PX
    )
    return {name: kept for name, (kept, _) in parts.items()}, warnings
