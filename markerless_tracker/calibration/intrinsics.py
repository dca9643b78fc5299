"""Start values of a camera: matrix and lens from its own views, and the board's poses in them."""

from dataclasses import dataclass

import cv2
import numpy as np

from markerless_tracker.calibration.detect import Seen
from markerless_tracker.calibration.views import BoardViews
from markerless_tracker.camera.board import Board
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, rotation_from_rodrigues, transform

LEAST_VIEWS = 6
"""Poses of the board that a camera must have seen."""
_MOST_VIEWS = 30
_AMBIGUOUS = 4.0
_CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-9)


@dataclass(frozen=True, eq=False)
class Lens:
    """Intrinsics of one camera: matrix (3, 3) px, distortion (5,) k1 k2 p1 p2 k3."""

    matrix: FloatArray
    distortion: FloatArray


def start_lens(views: BoardViews, camera: str, *, k3: bool = False) -> Lens:
    """Intrinsics of a camera by OpenCV's calibration (Zhang) from views as different as possible.

    Raises:
        CalibrationError: it saw the board in too few poses, or the views determine no camera.
    """
    seen = [entry for _, entry in views.of(camera)]
    if len(seen) < LEAST_VIEWS:
        raise CalibrationError(
            f"{camera} saw the board in {len(seen)} poses, expected {LEAST_VIEWS} or more: show it "
            "to this camera in more places of its image, tilted, and hold it still there"
        )
    corners = views.board.corners_m
    chosen = [seen[i] for i in _different(seen, views.board, views.sizes_px[camera])]
    flags = 0 if k3 else cv2.CALIB_FIX_K3
    try:
        error, matrix, distortion, _, _ = cv2.calibrateCamera(
            [corners[s.ids].astype(np.float32) for s in chosen],
            [s.pixels.astype(np.float32) for s in chosen],
            views.sizes_px[camera],
            None,  # type: ignore[call-overload]
            None,
            flags=flags,
            criteria=_CRITERIA,
        )
    except cv2.error as failure:
        raise CalibrationError(
            f"{camera}: its {len(chosen)} views of the board determine no camera "
            f"({str(failure).strip().splitlines()[-1]}); show the board tilted"
        ) from failure
    found, lens = np.asarray(matrix, dtype=np.float64), np.zeros(5)
    flat = np.asarray(distortion, float).ravel()
    lens[: min(5, flat.size)] = flat[:5]
    if not (np.isfinite(found).all() and np.isfinite(error) and found[0, 0] > 0.0):
        raise CalibrationError(
            f"{camera}: its {len(chosen)} views of the board determine no camera; show it tilted"
        )
    return Lens(found, lens)


def board_poses(seen: Seen, board: Board, lens: Lens) -> list[FloatArray]:
    """Poses `T_cam_board` (4, 4) that explain a view, best first.

    A plane seen from afar has two poses that look alike (infinitesimal plane-based pose
    estimation), and a symmetric board has as many more.
    """
    flat = cv2.undistortPoints(seen.pixels.reshape(-1, 1, 2), lens.matrix, lens.distortion).reshape(
        -1, 2
    )
    found = []
    for number, order in enumerate(board.symmetries):
        # Of a symmetric board all corners are seen; the other boards have the identity only.
        points = flat if number == 0 else flat[order]
        solved, turns, moves, errors = cv2.solvePnPGeneric(
            np.ascontiguousarray(board.corners_m[seen.ids]),
            np.ascontiguousarray(points),
            np.eye(3),
            np.zeros(4),
            flags=cv2.SOLVEPNP_IPPE,
        )
        if not solved:
            continue
        for turn, move, error in zip(turns, moves, np.ravel(errors), strict=True):
            pose = transform(rotation_from_rodrigues(turn), np.ravel(move))
            if pose[2, 3] > 0.0 and np.isfinite(pose).all():
                found.append((pose, float(error)))
    found.sort(key=lambda entry: entry[1])
    return [pose for pose, error in found if error <= _AMBIGUOUS * found[0][1] + 1e-3]


def _different(seen: list[Seen], board: Board, size_px: tuple[int, int]) -> list[int]:
    """Numbers of at most `_MOST_VIEWS` views, each as different as possible from those before.

    Compared are place, size and slant of the board in the image.
    """
    if len(seen) <= _MOST_VIEWS:
        return list(range(len(seen)))
    corners = board.corners_m[:, :2] / np.ptp(board.corners_m[:, :2])
    features = []
    for view in seen:
        plane, _ = cv2.findHomography(corners[view.ids], view.pixels / max(size_px))
        slant = np.zeros(2) if plane is None else np.clip(plane[2, :2] / plane[2, 2], -1.0, 1.0)
        middle = view.pixels.mean(axis=0) / max(size_px)
        spread = view.pixels.std(axis=0) / max(size_px)
        features.append(np.concatenate([middle, 2.0 * spread, slant]))
    table = np.array(features)
    chosen = [int(np.argmax(table[:, 2] + table[:, 3]))]
    nearest = np.linalg.norm(table - table[chosen[0]], axis=1)
    while len(chosen) < _MOST_VIEWS:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(table - table[chosen[-1]], axis=1))
    return sorted(set(chosen))
