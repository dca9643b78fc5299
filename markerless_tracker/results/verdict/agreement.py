"""Consistency of the silhouettes with each other, and the camera at fault if they are inconsistent.

The images of the visual hull fill the silhouettes if the rig is correct. The hull is small or empty
if two cameras are exchanged, if the order of the cameras is shifted, or if a camera has another
camera's background. Each of these faults is tried: two cameras exchanged, the order shifted, one
camera left out. The rig in which the silhouettes are consistent names the fault.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel, CameraRig, project_camera
from markerless_tracker.records import Observation
from markerless_tracker.tracking.evidence.grid import FINE_M
from markerless_tracker.tracking.evidence.hull import Hull, find_hulls

FITS = 0.95
"""Least fraction of the silhouettes that their hull fills in a correct rig. Recordings have 0.985
or more."""
GAIN, GAIN_OF_ORDER = 0.10, 0.05
"""Least gain in that fraction for a fault to be reported: with a camera left out, and with cameras
exchanged or shifted. The first is larger, since fewer cameras are consistent more easily."""
CERTAIN = 0.985
"""The trials end at a rig with at least this fraction. Cameras in a ring reach nearly the same in
mirrored order."""
MOST_CAMERAS = 8
"""Largest number of cameras among which faults are tried."""
_LEAST_LEFT = 3
"""A camera is left out only if this many remain: silhouettes of two are nearly always consistent.
"""

Views = Mapping[str, Observation]


@dataclass(frozen=True)
class Fault:
    """A fault of the rig, without which the silhouettes are consistent.

    Attributes:
        exchanged: the two cameras that are exchanged; empty if none.
        left_out: the camera that contradicts the others; empty if none.
        before, after: fraction of the silhouettes that their hull fills, with and without the
            fault.
        shifted: pairs of a camera and the one whose calibration it has; empty if none.
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
    """The fault that best explains inconsistent silhouettes; None if they are consistent.

    Args:
        rig: the cameras.
        frames: silhouettes of a few frames, by camera.
    """
    cameras = {camera.name: camera for camera in rig}
    before = _mean_fit(cameras, frames)
    if not frames or before >= FITS:
        return None
    names = [name for name in cameras if all(name in views for views in frames)][:MOST_CAMERAS]
    best: Fault | None = None
    for trial in _trials(cameras, names):
        # One frame is enough to choose.
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
    """A rig to try, and its differences from the given one."""

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
    """Cyclic shifts of the order of all cameras."""
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
    # Leaving out a camera improves the fit more easily than exchanging two.
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
    """Pixels (h, w) of a view that a hull covers, grown by 3/4 of its points' spacing."""
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
