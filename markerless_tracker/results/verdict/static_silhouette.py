"""Detects static parts of the silhouettes: furniture or a machine that the background lacks.

The silhouettes are compared with the tracked body at intervals, which are longer while the tracker
is overloaded. Pixels that are nearly always person, and lie beside the body in most comparisons,
are not the person's.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.fitness.raster.silhouette import body_masks
from markerless_tracker.imaging import Region
from markerless_tracker.records import Observation, TrackResult, TrackState
from markerless_tracker.tracking.search import pixels_per_m

EVERY_NS, LATER_EVERY_NS = 60_000_000, 2_000_000_000
"""Time between the first `MANY` comparisons, and between later ones. The second applies also while
the tracker's effort is below 1."""
MANY = 12
LEAST = 6
"""Least number of comparisons for a result."""
ALWAYS = 0.9
"""Least fraction of the comparisons in which a static pixel is person."""
BESIDE = 0.5
"""Least fraction of the comparisons in which it is person beside the body."""
BESIDE_M = 0.05
"""Pixels nearer to the body than this may be its clothes."""
THICK_M = 0.06
"""Thinner parts are errors of the outline."""
LEAST_M2 = 0.02
"""Least area, at the person's distance, to be reported."""


@dataclass(eq=False)
class _View:
    person: NDArray[np.uint32]
    beside: NDArray[np.uint32]
    comparisons: int = 0
    px_per_m: float = 0.0


class StaticSilhouette:
    """Compares silhouettes with the body over a run; memory is that of two images per camera.

    Args:
        rig: the cameras, as the tracker has them.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._cameras = {camera.name: camera for camera in rig}
        self._views: dict[str, _View] = {}
        self._last_ns: int | None = None
        self._comparisons = 0

    def warm_up(self, body: BodyModel) -> None:
        """Compile the kernels of a comparison, for bodies of this kind."""
        body_masks(body, body.neutral, list(self._cameras.values()))

    def add(self, result: TrackResult, body: BodyModel) -> dict[str, NDArray[np.bool_]]:
        """Add a frame; returns the body's mask (h, w) by camera, {} without a comparison."""
        if result.state is not TrackState.TRACKING or result.pose is None:
            return {}
        seldom = self._comparisons >= MANY or result.effort < 1.0
        every_ns = LATER_EVERY_NS if seldom else EVERY_NS
        # Stamps may jump backwards.
        if self._last_ns is not None and abs(result.stamp_ns - self._last_ns) < every_ns:
            return {}
        self._last_ns = result.stamp_ns
        self._comparisons += 1
        seen = [self._cameras[name] for name in result.observations]
        covered = body_masks(body, result.pose, seen)
        at = result.pose[body.root_position]
        for camera in seen:
            self._compare(camera, result.observations[camera.name], covered[camera.name])
            view = self._views[camera.name]
            view.px_per_m += (pixels_per_m(camera, at) - view.px_per_m) / view.comparisons
        return covered

    def found_m2(self) -> dict[str, float]:
        """Static area by camera, in m2 at the person's distance; cameras without any are absent."""
        found = {}
        for name, view in self._views.items():
            if view.comparisons < LEAST or not view.px_per_m > 0.0:
                continue
            still = view.person >= ALWAYS * view.comparisons
            still &= view.beside >= BESIDE * view.comparisons
            thick = _disc(0.5 * THICK_M * view.px_per_m)
            opened = cv2.morphologyEx(still.view(np.uint8), cv2.MORPH_OPEN, thick)
            area = float(np.count_nonzero(opened)) / view.px_per_m**2
            if area >= LEAST_M2:
                found[name] = area
        return found

    def _compare(
        self, camera: CameraModel, observation: Observation, covered: NDArray[np.bool_]
    ) -> None:
        view = self._views.get(camera.name)
        if view is None:
            empty = np.zeros(covered.shape, dtype=np.uint32)
            view = self._views[camera.name] = _View(empty, empty.copy())
        view.comparisons += 1
        # The margin uses the distance of earlier comparisons, which is exact enough.
        margin = _disc(BESIDE_M * view.px_per_m) if view.px_per_m else _disc(1.0)
        # Outside of the region there is no person.
        region = Region(
            *observation.offset_px,
            observation.offset_px[0] + observation.width,
            observation.offset_px[1] + observation.height,
        )
        around = region.grown(len(margin), camera.size_px)
        near = cv2.dilate(np.ascontiguousarray(covered[around.slices]).view(np.uint8), margin)
        person = observation.mask
        view.person[region.slices] += person
        view.beside[region.slices] += person & (near[region.relative_to(around).slices] == 0)


def _disc(radius_px: float) -> NDArray[np.uint8]:
    side = 2 * max(1, round(min(radius_px, 100.0))) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), dtype=np.uint8)
