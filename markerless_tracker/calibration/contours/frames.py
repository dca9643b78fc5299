"""Tracked frames that a calibration is refined with: few, and as different as possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.arrays import lay_out_views
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.observation import Observation, no_edges
from markerless_tracker.records import TrackResult, TrackState
from markerless_tracker.tracking.person.spread import EvenlySpread, most_different
from markerless_tracker.tracking.search import pixels_per_m

MOST = 28
"""Frames that are used."""
MOST_KEPT = 4 * MOST
"""Frames that are kept to choose from."""
APART_M = 0.15
"""Frames whose markers differ by less, as root mean square, repeat each other: the errors of the
body's shape and of the segmentation are the same in them."""
_LEAST_VIEWS = 2


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A tracked frame.

    Attributes:
        stamp_ns: time.
        pose: (p,) as tracked.
        markers_m: (m, 3) world.
        observations: evidence of the views that show the person.
    """

    stamp_ns: int
    pose: FloatArray
    markers_m: FloatArray
    observations: Mapping[str, Observation]


class FrameChoice:
    """Keeps frames of a run of any length, evenly spread over it."""

    def __init__(self) -> None:
        self._kept: EvenlySpread[SeenFrame] = EvenlySpread(MOST_KEPT)

    def add(self, result: TrackResult) -> None:
        """Take a frame; those that are not tracked are passed over."""
        pose, markers_m = result.pose, result.markers_m
        if result.state is not TrackState.TRACKING or pose is None or markers_m is None:
            return
        seen = {n: o for n, o in result.observations.items() if o.mask_words.any()}
        if len(seen) < _LEAST_VIEWS:
            return

        def without_edges() -> SeenFrame:
            views = {
                name: replace(one, edges=no_edges((one.height, one.width)))
                for name, one in seen.items()
            }
            return SeenFrame(result.stamp_ns, pose, markers_m, views)

        self._kept.offer(without_edges)

    def chosen(self) -> list[SeenFrame]:
        """At most `MOST` frames, each as far as possible from those before it in the list."""
        frames = self._kept.items
        markers = np.array([frame.markers_m for frame in frames])
        order = most_different(len(frames), MOST, lambda i: _distances_m(markers, markers[i]))
        return [frames[i] for i in order]


def contours_of(
    body: BodyModel,
    cameras: Sequence[CameraModel],
    observations: Mapping[str, Observation],
    markers_m: FloatArray,
    *,
    step_px: float,
    radius_m: float,
) -> ContourFrame:
    """Contour evidence of the cameras that have an observation.

    Args:
        body, step_px, radius_m: as of `ContourFrame`.
        cameras: the cameras; those without an observation are left out.
        observations: by camera name.
        markers_m: (m, 3) world, of the person; their centre sets the size of a metre in each view.
    """
    centre = np.nanmean(markers_m, axis=0)
    seen = {camera.name: camera for camera in cameras if camera.name in observations}
    return ContourFrame(
        body,
        seen,
        observations,
        lay_out_views(list(seen.values()), observations),
        pixels_per_m={name: pixels_per_m(camera, centre) for name, camera in seen.items()},
        step_px=step_px,
        radius_m=radius_m,
    )


def independence(frames: Sequence[SeenFrame]) -> FloatArray:
    """Weight (n,) of each frame: 1 if no other is like it, 1/k if k frames are the same.

    The sum is the effective number of independent frames.
    """
    markers = np.array([frame.markers_m for frame in frames])
    apart = np.array([_distances_m(markers, one) for one in markers])
    return np.asarray(1.0 / np.exp(-0.5 * (apart / APART_M) ** 2).sum(axis=1))


def extent_m(frames: Sequence[SeenFrame]) -> FloatArray:
    """How far (3,) the person's centre moves along the world's axes."""
    centres = np.array([np.nanmean(frame.markers_m, axis=0) for frame in frames])
    return np.asarray(np.ptp(centres, axis=0))


def _distances_m(markers: FloatArray, one: FloatArray) -> FloatArray:
    """Root mean square distance (n,) of markers (n, m, 3) from those of one frame (m, 3)."""
    squares = ((markers - one) ** 2).sum(axis=2)
    return np.asarray(np.sqrt(np.nanmean(squares, axis=1)))
