"""Doubts about a calibration: units, axes, cameras without a common field of view.

None of them is an error, since a rig may be unusual. But each is the sign of a common mistake, and
can be reported before any image is read.
"""

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera.model import CameraModel, CameraRig, project_camera
from markerless_tracker.geometry import FloatArray

FARTHEST_M = 60.0
"""Cameras that look at one person are nearer to each other."""
NEAREST_M = 0.2
"""Cameras nearer together than this, all of them, show a person from one side only."""
BELOW_M = -0.05
"""A camera lower than this is below the floor, z = 0."""
PRINCIPAL_POINT = 0.25
"""Largest distance of the principal point from the middle of the image, in image sizes."""
_MILLIMETRES = 1500.0
_AGREE = 0.5
_UPRIGHT = 0.5
_OVERHEAD = -0.8
_DEPTHS_M = np.geomspace(0.5, 20.0, 24)


def calibration_doubts(rig: CameraRig) -> tuple[str, ...]:
    """One line per doubt; empty if there is none."""
    found = [*_distances(rig)]
    # If the units are wrong, no other doubt can be judged in metres.
    if not found:
        found += _axes(rig) or [*_upside_down(rig), *_below_the_floor(rig)]
        found += _nothing_in_common(rig)
    return (*found, *_principal_points(rig))


def _distances(rig: CameraRig) -> list[str]:
    centres = np.array([camera.T_world_cam[:3, 3] for camera in rig])
    if len(centres) < 2:
        return []
    farthest = float(np.linalg.norm(centres[:, None] - centres, axis=2).max())
    if farthest > FARTHEST_M:
        unit = "millimetres" if farthest > _MILLIMETRES else "centimetres"
        return [
            f"calibration: the cameras are up to {farthest:.0f} m apart, expected at most "
            f"{FARTHEST_M:g} m: are the translations in {unit} instead of metres?"
        ]
    if farthest < NEAREST_M:
        return [
            f"calibration: the cameras are at most {farthest:.3f} m apart, expected more than "
            f"{NEAREST_M:g} m: are the translations in metres, and from the world to the camera?"
        ]
    return []


def _axes(rig: CameraRig) -> list[str]:
    """Whether up in the images is not up in the world."""
    # Cameras that look steeply down from above say nothing about up.
    ups = [_up(camera) for camera in rig if not _is_overhead(camera)]
    if not ups:
        return []
    mean = np.mean(ups, axis=0)
    length = float(np.linalg.norm(mean))
    if length < _AGREE or mean[2] >= _UPRIGHT * length:
        return []
    axis = int(np.abs(mean).argmax())
    name = ("+" if mean[axis] > 0.0 else "-") + "xyz"[axis]
    return [
        f"calibration: up in the images is about the world's {name} axis, expected +z: is its "
        "world Z-up? (that of some programs is Y-up, or that of the first camera)"
    ]


def _upside_down(rig: CameraRig) -> list[str]:
    names = [camera.name for camera in rig if _up(camera)[2] < -_UPRIGHT]
    return [f"calibration: {', '.join(names)}: upside down"] if names else []


def _below_the_floor(rig: CameraRig) -> list[str]:
    low = {camera.name: float(camera.T_world_cam[2, 3]) for camera in rig}
    low = {name: z for name, z in low.items() if z < BELOW_M}
    if not low:
        return []
    listed = ", ".join(f"{name} by {-z:.2f} m" for name, z in low.items())
    return [f"calibration: below the floor, z = 0: {listed}; is the world's origin on the floor?"]


def _nothing_in_common(rig: CameraRig) -> list[str]:
    """Cameras that see nothing of what two others see."""
    enough = min(2, len(rig) - 1)
    if not enough:
        return []
    alone = []
    for camera in rig:
        points = _looked_at(camera)
        others = np.sum([_sees(other, points) for other in rig if other is not camera], axis=0)
        if others.max() < enough:
            alone.append(camera.name)
    if not alone:
        return []
    return [
        f"calibration: {', '.join(alone)}: nothing in view that {enough} other camera(s) see; are "
        "rotation and translation from the world to the camera?"
    ]


def _principal_points(rig: CameraRig) -> list[str]:
    found = []
    for camera in rig:
        size = np.array(camera.size_px, dtype=np.float64)
        point = camera.matrix[:2, 2]
        if (np.abs(point + 0.5 - 0.5 * size) > PRINCIPAL_POINT * size).any():
            found.append(
                f"calibration: {camera.name}: principal point ({point[0]:.0f}, {point[1]:.0f}) far "
                f"from the middle of images of {camera.size_px[0]}x{camera.size_px[1]} px: was it "
                "calibrated with images of that size?"
            )
    return found


def _up(camera: CameraModel) -> FloatArray:
    """Direction (3,) of up in the image, world frame."""
    return np.asarray(-camera.T_world_cam[:3, 1])


def _is_overhead(camera: CameraModel) -> bool:
    placed = camera.T_world_cam
    return bool(placed[2, 2] < _OVERHEAD and placed[2, 3] > 0.0)


def _looked_at(camera: CameraModel) -> FloatArray:
    """Points (n, 3) m, world frame, in the middle of what a camera sees."""
    width, height = camera.size_px
    u, v = np.meshgrid(np.array([0.25, 0.5, 0.75]) * width, np.array([0.25, 0.5, 0.75]) * height)
    pixels = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
    rays = pixels @ np.linalg.inv(camera.matrix).T
    points = (_DEPTHS_M[:, None, None] * rays).reshape(-1, 3)
    placed = camera.T_world_cam
    return np.asarray(points @ placed[:3, :3].T + placed[:3, 3])


def _sees(camera: CameraModel, points: FloatArray) -> NDArray[np.bool_]:
    """Which points (n, 3) m are in a camera's image."""
    with np.errstate(invalid="ignore"):
        pixels = project_camera(points, camera)
        inside = (pixels >= 0.0).all(axis=1) & (pixels < camera.size_px).all(axis=1)
    return np.asarray(inside)
