"""The views of one time to the evidence of the tracked body, cameras side by side."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraRig
from markerless_tracker.errors import ImageError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import BackgroundModel, Image, Segmenter
from markerless_tracker.records import Observation
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.selection import explained_part


class EvidenceMaker:
    """Turns views into observations, and keeps of their silhouettes what the prediction explains.

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
        self._margin_px = config.component_margin_px
        self._pool = pool
        self.segmenters: dict[str, Segmenter] = {}
        for camera in rig:
            background = backgrounds.get(camera.name)
            if background is None:
                continue
            if background.size_px != camera.size_px:
                raise ImageError(
                    f"{camera.name}: background of {background.size_px[0]}x"
                    f"{background.size_px[1]} px, its calibration says "
                    f"{camera.size_px[0]}x{camera.size_px[1]}"
                )
            self.segmenters[camera.name] = Segmenter(camera.name, background, config)

    def observe(
        self, views: Mapping[str, Image | Observation], stamp_ns: int
    ) -> dict[str, Observation]:
        """Observations of the views; ready-made ones pass.

        Raises:
            ImageError, CalibrationError: no view, an unknown camera, an image without a background
                or one that does not fit; names the camera.
        """
        if not views:
            raise ImageError(f"no view came, expected some of {', '.join(self._rig.names)}")
        for name in views:
            self._rig[name]

        def evidence(item: tuple[str, Image | Observation]) -> Observation:
            name, view = item
            if isinstance(view, Observation):
                return view
            if name not in self.segmenters:
                raise ImageError(
                    f"{name}: an image came, but no background to tell the person from"
                )
            return self.segmenters[name].observe(view, stamp_ns)

        return dict(zip(views, self._pool.map(evidence, views.items()), strict=True))

    def select(
        self, observed: Mapping[str, Observation], body: BodyModel, predicted: FloatArray
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """Keep the components that a predicted pose (p,) explains; say what was left out."""

        def part(item: tuple[str, Observation]) -> tuple[Observation, int]:
            name, observation = item
            return explained_part(observation, self._rig[name], body, predicted, self._margin_px)

        parts = dict(zip(observed, self._pool.map(part, observed.items()), strict=True))
        warnings = tuple(
            f"{name}: {left_out} px of silhouette away from the body left out"
            for name, (_, left_out) in parts.items()
            if left_out
        )
        return {name: kept for name, (kept, _) in parts.items()}, warnings
