"""Bundle adjustment: all cameras and all poses of the board, least squares of the pixel errors."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from markerless_tracker.calibration.intrinsics import Lens
from markerless_tracker.calibration.layout import Layout
from markerless_tracker.calibration.levenberg import minimised
from markerless_tracker.calibration.views import BoardViews
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.geometry import (
    FloatArray,
    rodrigues_from_rotation,
    rotation_from_rodrigues,
    transform,
)

CAMERA, BOARD = 15, 6
"""Parameters of a camera: fx fy cx cy k1 k2 p1 p2 k3, Rodrigues vector and translation from the
world; of a pose of the board: the same six from the board to the world."""
OUTLIER, OUTLIER_PX = 5.0, 1.0
"""An outlier's error exceeds both `OUTLIER` times the median error and `OUTLIER_PX`."""
_LOSS_PX = 0.5
_DEPTH_M = 1e-3
# Added to the diagonal of scaled normal equations, so that what is not determined has an inverse.
_RIDGE = 1e-12
# Beyond this factor from errors to variances, nothing is determined.
_UNSURE = 1e-3 / _RIDGE


@dataclass(frozen=True, eq=False)
class Bundle:
    """The adjusted cameras.

    Attributes:
        rig: the cameras, in the order given; world: the board on the floor.
        boards: `T_world_board` (4, 4) of every set.
        camera, pose, corner: (n,) camera, set and corner of every observation.
        seen_px: (n, 2) observed positions.
        error_px: (n, 2) projected minus observed.
        used: (n,) whether an observation is no outlier.
        sd: camera -> (15,) standard deviations of its parameters; 0 of those held fixed.
        position_sd_m: camera -> (3,) standard deviations of its position in the world, m.
    """

    rig: CameraRig
    boards: tuple[FloatArray, ...]
    camera: NDArray[np.intp]
    pose: NDArray[np.intp]
    corner: NDArray[np.intp]
    seen_px: FloatArray
    error_px: FloatArray
    used: NDArray[np.bool_]
    sd: Mapping[str, FloatArray]
    position_sd_m: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class _Data:
    camera: NDArray[np.intp]
    pose: NDArray[np.intp]
    corner: NDArray[np.intp]
    pixels: FloatArray
    points_m: FloatArray


def adjust(
    views: BoardViews, lenses: Mapping[str, Lens], layout: Layout, *, k3: bool = False
) -> Bundle:
    """Adjust cameras and poses of the board together; the pose on the floor is fixed.

    A robust loss first, then plain least squares without outliers.

    Args:
        views: the corners.
        lenses, layout: start values.
        k3: whether the third radial coefficient is free.
    """
    names = list(lenses)
    data = _observations(views, names, layout)
    start = np.concatenate(
        [*(_camera_vector(lenses[n], layout.T_cam_world[n]) for n in names),
         *(_pose_vector(pose) for pose in layout.T_world_board[1:])]
    )  # fmt: skip
    free = np.ones(start.size, dtype=bool)
    if not k3:
        free[8 : CAMERA * len(names) : CAMERA] = False
    used = np.ones(len(data.pixels), dtype=bool)
    value, _ = _solved(data, used, start, free, len(names), loss_px=_LOSS_PX)
    size = np.linalg.norm(projection(value, data, len(names))[0], axis=1)
    used = size <= max(OUTLIER * float(np.median(size)), OUTLIER_PX)
    value, jacobian = _solved(data, used, value, free, len(names), loss_px=None)
    errors = projection(value, data, len(names))[0]
    covariance = _covariance(jacobian, errors[used], free)
    cameras, sd, position_sd_m = [], {}, {}
    for number, name in enumerate(names):
        own = slice(CAMERA * number, CAMERA * (number + 1))
        cameras.append(_camera(name, views.sizes_px[name], value[own]))
        sd[name] = np.sqrt(np.diag(covariance)[own])
        position_sd_m[name] = _position_sd_m(value[own], covariance[own, own])
    rest = value[CAMERA * len(names) :].reshape(-1, BOARD)
    boards = (np.eye(4), *(_pose(vector) for vector in rest))
    return Bundle(
        CameraRig(tuple(cameras)), boards, data.camera, data.pose, data.corner, data.pixels,
        errors, used, sd, position_sd_m,
    )  # fmt: skip


def _observations(views: BoardViews, names: list[str], layout: Layout) -> _Data:
    camera, pose, corner, pixels = [], [], [], []
    for number, seen in enumerate(views.sets):
        for name, view in seen.items():
            order = layout.orders[number].get(name)
            if order is None:
                continue
            there = view.pixels if order == 0 else view.pixels[views.board.symmetries[order]]
            camera.append(np.full(len(there), names.index(name)))
            pose.append(np.full(len(there), number))
            corner.append(view.ids)
            pixels.append(there)
    corners = np.concatenate(corner)
    return _Data(
        np.concatenate(camera).astype(np.intp),
        np.concatenate(pose).astype(np.intp),
        corners.astype(np.intp),
        np.concatenate(pixels),
        views.board.corners_m[corners],
    )


def _solved(
    data: _Data,
    used: NDArray[np.bool_],
    start: FloatArray,
    free: NDArray[np.bool_],
    cameras: int,
    *,
    loss_px: float | None,
) -> tuple[FloatArray, csr_matrix]:
    chosen = _Data(
        data.camera[used], data.pose[used], data.corner[used], data.pixels[used],
        data.points_m[used],
    )  # fmt: skip
    columns = np.flatnonzero(free)
    value = start.copy()

    def model(part: FloatArray) -> tuple[FloatArray, csr_matrix]:
        value[columns] = part
        errors, blocks = projection(value, chosen, cameras)
        return errors.ravel(), _sparse(blocks, chosen, start.size, cameras)[:, columns]

    value[columns] = minimised(model, start[columns], loss_px=loss_px)
    return value, model(value[columns].copy())[1]


def _sparse(blocks: FloatArray, data: _Data, parameters: int, cameras: int) -> csr_matrix:
    """The Jacobian (2n, p) of blocks (n, 2, 21): by the camera and by the pose of the board."""
    at_camera = CAMERA * data.camera[:, None] + np.arange(CAMERA)
    at_board = CAMERA * cameras + BOARD * (data.pose[:, None] - 1) + np.arange(BOARD)
    at = np.repeat(np.concatenate([at_camera, at_board], axis=1)[:, None], 2, axis=1)
    row = np.broadcast_to(np.arange(2 * len(blocks)).reshape(-1, 2, 1), at.shape)
    # The pose of the first set is fixed.
    present = np.ones(at.shape, dtype=bool)
    present[data.pose == 0, :, CAMERA:] = False
    entries = (blocks[present], (row[present], at[present]))
    return csr_matrix(entries, shape=(2 * len(blocks), parameters))


def projection(value: FloatArray, data: _Data, cameras: int) -> tuple[FloatArray, FloatArray]:
    """Errors (n, 2) px, projected minus observed, and their derivatives (n, 2, 21).

    Derivatives by the parameters of the camera, then by those of the board's pose.
    """
    lens = value[: CAMERA * cameras].reshape(-1, CAMERA)
    poses = np.vstack([np.zeros(BOARD), value[CAMERA * cameras :].reshape(-1, BOARD)])
    board_turn, board_left = (table[data.pose] for table in _turns(poses[:, :3]))
    camera_turn, camera_left = (table[data.camera] for table in _turns(lens[:, 9:12]))
    turned = np.einsum("nij,nj->ni", board_turn, data.points_m)
    world = turned + poses[data.pose, 3:]
    seen = np.einsum("nij,nj->ni", camera_turn, world)
    x, y, z = (seen + lens[data.camera, 12:15]).T
    z = np.maximum(z, _DEPTH_M)
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens[data.camera, :9].T
    a, b = x / z, y / z
    r2, ab = a * a + b * b, a * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    lens_a = a * radial + 2.0 * p1 * ab + p2 * (r2 + 2.0 * a * a)
    lens_b = b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * ab
    errors = np.column_stack([fx * lens_a + cx, fy * lens_b + cy]) - data.pixels
    blocks = np.zeros((len(x), 2, CAMERA + BOARD))
    blocks[:, 0, 0], blocks[:, 1, 1] = lens_a, lens_b
    blocks[:, 0, 2] = blocks[:, 1, 3] = 1.0
    for column, power in ((4, r2), (5, r2 * r2), (8, r2 * r2 * r2)):
        blocks[:, 0, column], blocks[:, 1, column] = fx * a * power, fy * b * power
    blocks[:, 0, 6], blocks[:, 1, 6] = fx * 2.0 * ab, fy * (r2 + 2.0 * b * b)
    blocks[:, 0, 7], blocks[:, 1, 7] = fx * (r2 + 2.0 * a * a), fy * 2.0 * ab
    by_a = np.stack(
        [fx * (radial + 2.0 * a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a),
         fy * (2.0 * ab * slope + 2.0 * p1 * a + 2.0 * p2 * b)], axis=1
    )  # fmt: skip
    by_b = np.stack(
        [fx * (2.0 * ab * slope + 2.0 * p1 * a + 2.0 * p2 * b),
         fy * (radial + 2.0 * b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a)], axis=1
    )  # fmt: skip
    by_point = np.stack([by_a, by_b, -(by_a * a[:, None] + by_b * b[:, None])], axis=2)
    by_point /= z[:, None, None]
    blocks[:, :, 9:12] = -by_point @ _skews(seen) @ camera_left
    blocks[:, :, 12:15] = by_point
    by_world = by_point @ camera_turn
    blocks[:, :, 15:18] = -by_world @ _skews(turned) @ board_left
    blocks[:, :, 18:21] = by_world
    return errors, blocks


def _turns(vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotations (n, 3, 3) of Rodrigues vectors (n, 3), and their left Jacobians (n, 3, 3)."""
    rotations = np.array([rotation_from_rodrigues(vector) for vector in vectors])
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    safe = np.maximum(angle, 1e-6)
    cross = _skews(vectors)
    left = (
        np.eye(3)
        + (1.0 - np.cos(safe)) / safe**2 * cross
        + (safe - np.sin(safe)) / safe**3 * (cross @ cross)
    )
    return rotations, left


def _skews(vectors: FloatArray) -> FloatArray:
    """Matrices (n, 3, 3) of the cross products with vectors (n, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _covariance(jacobian: csr_matrix, errors: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Covariance (p, p) of all parameters.

    Parameters that the views do not determine have an infinite variance, and no covariances.
    """
    freedom = max(errors.size - int(free.sum()), 1)
    variance = float((errors**2).sum()) / freedom
    normal = (jacobian.T @ jacobian).toarray()
    # A pose whose corners are all outliers is not determined; it must not affect the others.
    known = np.diag(normal) > 0.0
    columns = np.flatnonzero(free)
    normal = normal[np.ix_(known, known)]
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    scaled = normal / scale[:, None] / scale
    covariance = np.zeros((free.size, free.size))
    covariance[columns, columns] = np.inf
    try:
        inverse = np.linalg.inv(scaled + _RIDGE * np.eye(len(scaled)))
    except np.linalg.LinAlgError:
        return covariance  # The views determine nothing.
    # With one or two corners left, a pose is not determined either.
    factors = np.diag(inverse)
    sure = (factors >= 0.0) & (factors < _UNSURE)
    found = variance * inverse / scale[:, None] / scale
    at = columns[known][sure]
    covariance[np.ix_(at, at)] = found[np.ix_(sure, sure)]
    return covariance


def _position_sd_m(value: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard deviations (3,) of a camera's position -Rᵀt, from those of its parameters (15,)."""
    pose = covariance[9:CAMERA, 9:CAMERA]
    if not np.isfinite(np.diag(pose)).all():
        return np.full(3, np.inf)
    rotations, left = _turns(value[None, 9:12])
    to_world, shift = rotations[0].T, value[None, 12:15]
    by_pose = -to_world @ np.hstack([_skews(shift)[0] @ left[0], np.eye(3)])
    return np.sqrt(np.maximum(np.diag(by_pose @ pose @ by_pose.T), 0.0))


def _camera_vector(lens: Lens, T_cam_world: FloatArray) -> FloatArray:
    k = lens.matrix
    return np.concatenate(
        [[k[0, 0], k[1, 1], k[0, 2], k[1, 2]], lens.distortion, _pose_vector(T_cam_world)]
    )


def _pose_vector(pose: FloatArray) -> FloatArray:
    return np.concatenate([rodrigues_from_rotation(pose[:3, :3]), pose[:3, 3]])


def _pose(vector: FloatArray) -> FloatArray:
    return transform(rotation_from_rodrigues(vector[:3]), vector[3:])


def _camera(name: str, size_px: tuple[int, int], value: FloatArray) -> CameraModel:
    fx, fy, cx, cy = value[:4]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraModel(name, size_px, matrix, value[4:9], _pose(value[9:15]))
