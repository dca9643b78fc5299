"""Whether silhouettes fit together by themselves, and which camera is wrong if they do not.

Silhouettes of the cameras of one rig have a visual hull whose images fill them. If two cameras are
exchanged, all are numbered from another one on, or one has another camera's background, the hull is
small or nowhere. The rigs without one camera, with two exchanged, and with all shifted along their
order are tried: what makes them fit names the fault.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.records import Observation
from markerless_tracker.tracking.start.hull import FINE_M, Hull, find_hulls

FITS = 0.95
"""Fraction of the silhouettes that their hull fills, if cameras and silhouettes belong together; in
recordings it is 0.985 or more."""
GAIN, GAIN_OF_ORDER = 0.10, 0.05
"""Least gain in that fraction by which a fault is named: without a camera, and with all in another
order. Fewer cameras fit together more easily."""
CERTAIN = 0.985
"""From this fraction on nothing else is tried: cameras in a ring fit nearly as well in mirrored
order."""
MOST_CAMERAS = 8
"""Exchanges are tried among so many cameras."""
_LEAST_LEFT = 3
"""With two cameras left nearly all silhouettes fit together."""

Views = Mapping[str, Observation]


@dataclass(frozen=True)
class Fault:
    """What makes the silhouettes fit together.

    Attributes:
        exchanged: two cameras to be exchanged; empty if none.
        left_out: a camera to be left out; empty if none.
        before, after: fraction of the silhouettes that their hull fills.
        shifted: all cameras, each with the one whose calibration it has; empty if none.
    """

    exchanged: tuple[str, ...]
    left_out: str
    before: float
    after: float
    shifted: tuple[tuple[str, str], ...] = ()

    @property
    def cameras(self) -> tuple[str, ...]:
        """The cameras at fault."""
        return self.exchanged or tuple(name for name, _ in self.shifted) or (self.left_out,)

    def describe(self) -> str:
        """The fault in one line."""
        if self.exchanged:
            a, b = self.exchanged
            return (
                f"{a} and {b} seem to be exchanged: all silhouettes fit together to "
                f"{self.after:.0%} then, instead of {self.before:.0%}"
            )
        if self.shifted:
            listed = ", ".join(f"{name} has that of {other}" for name, other in self.shifted)
            return (
                f"the calibrations seem to be in another order: {listed}; all silhouettes fit "
                f"together to {self.after:.0%} with each camera's own, instead of {self.before:.0%}"
            )
        return (
            f"{self.left_out} contradicts the other cameras: without it the silhouettes fit "
            f"together to {self.after:.0%}, with it to {self.before:.0%}; check its calibration, "
            "its background and its time"
        )


def find_fault(rig: CameraRig, frames: Sequence[Views]) -> Fault | None:
    """The fault that explains best why silhouettes do not fit together; None if they do.

    Args:
        rig: the cameras.
        frames: silhouettes of a few moments, by camera.
    """
    cameras = {camera.name: camera for camera in rig}
    before = _mean_fit(cameras, frames)
    if not frames or before >= FITS:
        return None
    names = [name for name in cameras if all(name in views for views in frames)][:MOST_CAMERAS]
    best: Fault | None = None
    for trial in _trials(cameras, names):
        # One moment is enough to choose.
        fault = trial.fault(frames[:1], before)
        if best is None or _worth(fault) > _worth(best):
            best, chosen = fault, trial
        if fault.after >= CERTAIN:
            break
    if best is None:
        return None
    best = chosen.fault(frames, before)
    gain = GAIN if best.left_out else GAIN_OF_ORDER
    if best.after < before + gain or best.after < 0.5 * (FITS + before):
        return None
    return best


@dataclass(frozen=True, eq=False)
class _Trial:
    """A rig to try, and the cameras that are not those of the given one."""

    cameras: Mapping[str, CameraModel]
    exchanged: tuple[str, ...] = ()
    left_out: str = ""
    shifted: tuple[tuple[str, str], ...] = ()

    def fault(self, frames: Sequence[Views], before: float) -> Fault:
        used = [{n: v for n, v in views.items() if n in self.cameras} for views in frames]
        after = _mean_fit(self.cameras, used)
        return Fault(self.exchanged, self.left_out, before, after, self.shifted)


def _trials(cameras: Mapping[str, CameraModel], names: Sequence[str]) -> Iterator[_Trial]:
    for a, b in combinations(names, 2):
        if cameras[a].size_px == cameras[b].size_px:
            swapped = {a: replace(cameras[b], name=a), b: replace(cameras[a], name=b)}
            yield _Trial({**cameras, **swapped}, exchanged=(a, b))
    yield from _shifts(cameras, names)
    if len(names) > _LEAST_LEFT:
        for name in names:
            yield _Trial({n: c for n, c in cameras.items() if n != name}, left_out=name)


def _shifts(cameras: Mapping[str, CameraModel], names: Sequence[str]) -> Iterator[_Trial]:
    """All cameras numbered from another one on."""
    count = len(names)
    same_size = len({camera.size_px for camera in cameras.values()}) == 1
    if count < 3 or count != len(cameras) or not same_size:
        return
    for by in range(1, count):
        shifted = tuple((name, names[(k + by) % count]) for k, name in enumerate(names))
        own = {other: replace(cameras[name], name=other) for name, other in shifted}
        yield _Trial(own, shifted=shifted)


def largest_hull(rig: CameraRig, views: Views) -> Hull | None:
    """The largest component of the visual hull that may be a person; None if there is none."""
    return next(find_hulls({camera.name: camera for camera in rig}, views), None)


def _worth(fault: Fault) -> float:
    # Without a camera the others fit together more easily than with two exchanged.
    return fault.after - (0.05 if fault.left_out else 0.0)


def _mean_fit(cameras: Mapping[str, CameraModel], frames: Sequence[Views]) -> float:
    return float(np.mean([_fit(cameras, views) for views in frames])) if frames else 1.0


def _fit(cameras: Mapping[str, CameraModel], views: Views) -> float:
    """Fraction of the silhouettes that the largest component of their hull fills; 0 without one."""
    hull = next(find_hulls(cameras, views), None)
    if hull is None:
        return 0.0
    filled = total = 0
    for name, view in views.items():
        person = view.mask
        total += int(person.sum())
        filled += int((person & _image(hull, cameras[name], view)).sum())
    return filled / total if total else 0.0


def _image(hull: Hull, camera: CameraModel, view: Observation) -> NDArray[np.bool_]:
    """Pixels (h, w) of a view that a hull covers, grown by half its points' spacing."""
    pixels = project_camera(hull.points_m, camera) - view.offset_px
    with np.errstate(invalid="ignore"):
        u, v = np.round(pixels).T
        framed = (u >= 0) & (v >= 0) & (u < view.width) & (v < view.height)
    covered = np.zeros((view.height, view.width), dtype=np.uint8)
    covered[v[framed].astype(np.int64), u[framed].astype(np.int64)] = 1
    middle = hull.points_m.mean(axis=0)
    depth = float(camera.T_cam_world[2, :3] @ middle + camera.T_cam_world[2, 3])
    radius = 0.75 * FINE_M * float(camera.matrix[0, 0]) / max(depth, 1.0)
    side = 2 * max(1, round(min(radius, 50.0))) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(cv2.dilate(covered, kernel)).astype(np.bool_)
