"""Changes of cameras: pose and focal length, and their effect on residuals.

A change (7,) of a camera: rotation about its own x, y and z axis (tilt, pan, roll; rad), motion of
its centre along them (m), and change of the logarithm of its focal lengths.
"""

from dataclasses import replace

import numpy as np

from markerless_tracker.camera import CameraModel
from markerless_tracker.fitness.arrays import ViewArrays
from markerless_tracker.geometry import (
    FloatArray,
    rodrigues_from_rotation,
    rotation_from_rodrigues,
    transform,
)

CHANGES = 7
"""Numbers of a camera's change."""
ROTATION, POSITION, FOCAL = slice(0, 3), slice(3, 6), slice(6, 7)


def moved(camera: CameraModel, change: FloatArray) -> CameraModel:
    """The camera after a change (7,)."""
    rotation = camera.T_cam_world[:3, :3]
    centre = camera.T_world_cam[:3, 3] + rotation.T @ change[POSITION]
    turned = rotation_from_rodrigues(change[ROTATION]) @ rotation
    matrix = camera.matrix.copy()
    matrix[[0, 0, 1], [0, 1, 1]] *= np.exp(change[6])
    return replace(camera, matrix=matrix, T_cam_world=transform(turned, -turned @ centre))


def change_between(before: CameraModel, after: CameraModel) -> FloatArray:
    """The change (7,) that makes one camera of another."""
    rotation = before.T_cam_world[:3, :3]
    shift = after.T_world_cam[:3, 3] - before.T_world_cam[:3, 3]
    return np.concatenate(
        [
            rodrigues_from_rotation(after.T_cam_world[:3, :3] @ rotation.T),
            rotation @ shift,
            [np.log(after.matrix[0, 0] / before.matrix[0, 0])],
        ]
    )


def put(arrays: ViewArrays, view: int, camera: CameraModel) -> None:
    """Replace the camera of one view in the kernels' arrays."""
    k = camera.matrix
    arrays.rotation[view] = camera.T_cam_world[:3, :3]
    arrays.translation[view] = camera.T_cam_world[:3, 3]
    arrays.intrinsics[view] = k[0, 0], k[0, 1], k[0, 2], k[1, 1], k[1, 2]


def change_jacobian(camera: CameraModel, points_m: FloatArray, gradient: FloatArray) -> FloatArray:
    """Derivatives (n, 7) of residuals of one view by its camera's change.

    Args:
        camera: the camera.
        points_m: (n, 3) world points of the outline.
        gradient: (n, 3) of the residuals with respect to them.
    """
    seen, by_seen = _in_camera(camera, points_m, gradient)
    by_bent, bent = _by_bent(camera, seen, by_seen)
    by_focal = (by_bent * bent).sum(axis=1)
    return np.column_stack([np.cross(seen, by_seen), -by_seen, by_focal])


def shift_jacobian(camera: CameraModel, points_m: FloatArray, gradient: FloatArray) -> FloatArray:
    """Derivatives (n, 2) of residuals of one view by a shift (u, v) px of the projected points.

    Arguments as of `change_jacobian`.
    """
    by_bent, _ = _by_bent(camera, *_in_camera(camera, points_m, gradient))
    (fx, skew), (_, fy) = camera.matrix[:2, :2]
    by_u = by_bent[:, 0] / fx
    return np.column_stack([by_u, (by_bent[:, 1] - skew * by_u) / fy])


def _in_camera(
    camera: CameraModel, points_m: FloatArray, gradient: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points and gradients (n, 3) in the camera's frame."""
    to_camera = camera.T_cam_world
    return points_m @ to_camera[:3, :3].T + to_camera[:3, 3], gradient @ to_camera[:3, :3].T


def _by_bent(
    camera: CameraModel, seen: FloatArray, by_seen: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradients (n, 2) with respect to the distorted positions at focal length 1, and these."""
    bent, aa, ab, bb = _lens(seen[:, :2] / seen[:, 2:], camera.distortion)
    by_flat = by_seen[:, :2] * seen[:, 2:]
    determinant = aa * bb - ab * ab
    by_bent = np.column_stack(
        [bb * by_flat[:, 0] - ab * by_flat[:, 1], aa * by_flat[:, 1] - ab * by_flat[:, 0]]
    )
    return by_bent / determinant[:, None], bent


def _lens(
    flat: FloatArray, distortion: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Distorted positions (n, 2) of points at focal length 1; derivatives (n,) aa, ab = ba and bb.

    The first letter names the distorted coordinate, the second the undistorted one.
    """
    k1, k2, p1, p2, k3 = distortion
    a, b = flat.T
    r2, ab = a * a + b * b, a * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    rate = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    bent = np.column_stack(
        [
            a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a),
            b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab,
        ]
    )
    return (
        bent,
        radial + a * a * rate + 2.0 * p1 * b + 6.0 * p2 * a,
        ab * rate + 2.0 * (p1 * a + p2 * b),
        radial + b * b * rate + 6.0 * p1 * b + 2.0 * p2 * a,
    )
