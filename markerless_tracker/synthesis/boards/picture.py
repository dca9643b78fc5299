"""The picture of a board in a camera: its print, warped by the true lens, with optical blur."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.camera.board import CHARUCO, Board, charuco_board
from markerless_tracker.geometry import FloatArray, apply

Picture = NDArray[np.float32]

MARGIN = 1.0
"""White border of the print, in squares."""
BLUR_PX = 0.6
"""Standard deviation of the lens's blur."""
_BLACK, _WHITE, _BACK = 25.0, 225.0, 150.0
_SQUARE_PX = 160
_SAMPLES = 3
_PAD_PX = 4
_LEVELS = 6
_OUTLINE = 12
_ITERATIONS = 30
_ALONG = 1e-9


def board_print(board: Board) -> Picture:
    """The print (h, w) with its border, grey levels, `_SQUARE_PX` px per square."""
    size = (board.columns * _SQUARE_PX, board.rows * _SQUARE_PX)
    if board.kind == CHARUCO:
        drawing = charuco_board(board)
        draw = drawing.generateImage if hasattr(drawing, "generateImage") else drawing.draw
        dark = np.asarray(draw(size)) < 128
    else:
        column, row = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
        dark = (column // _SQUARE_PX + row // _SQUARE_PX) % 2 == 0
    inner = np.where(dark, _BLACK, _WHITE).astype(np.float32)
    border = round(MARGIN * _SQUARE_PX)
    return np.pad(inner, border, constant_values=_WHITE)


class BoardView:
    """Draws one board into the pictures of one camera.

    Args:
        board: the board.
        camera: the camera, lens included.
    """

    def __init__(self, board: Board, camera: CameraModel) -> None:
        self._board, self._camera = board, camera
        first = board_print(board)
        self._prints = [first]
        for _ in range(_LEVELS):
            last = self._prints[-1]
            size = (last.shape[1] // 2, last.shape[0] // 2)
            self._prints.append(
                np.asarray(cv2.resize(last, size, interpolation=cv2.INTER_AREA), np.float32)
            )
        self._plane = _undistorted(camera)

    def draw(self, image: Picture, poses: list[FloatArray]) -> Picture:
        """The picture (h, w, 3) with the board at the mean of several poses (motion blur).

        Args:
            image: (h, w, 3) BGR, grey levels; not changed.
            poses: `T_world_board` (4, 4) during the exposure.
        """
        width, height = self._camera.size_px
        outlines = [self._outline(pose) for pose in poses]
        if not all(np.isfinite(outline).all() for outline in outlines):
            return image
        every = np.concatenate(outlines)
        low = np.maximum(np.floor(every.min(axis=0)).astype(int) - _PAD_PX, 0)
        high = np.minimum(
            np.ceil(every.max(axis=0)).astype(int) + _PAD_PX + 1, np.array([width, height])
        )
        if (high - low < 2).any():
            return image
        drawn = np.mean([self._patch(pose, low, high) for pose in poses], axis=0)
        drawn = cv2.GaussianBlur(drawn.astype(np.float32), (0, 0), BLUR_PX)
        result = image.copy()
        part = result[low[1] : high[1], low[0] : high[0]]
        part *= 1.0 - drawn[..., 1:]
        part += drawn[..., :1]
        return result

    def _outline(self, pose: FloatArray) -> FloatArray:
        """Pixels (n, 2) along the border of the print."""
        grown = self._board.outline_m.copy()
        grown[:, :2] += (
            MARGIN * self._board.square_m * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
        )
        ends = np.roll(grown, -1, axis=0)
        shares = np.linspace(0.0, 1.0, _OUTLINE)[:, None, None]
        border = (grown + shares * (ends - grown)).reshape(-1, 3)
        return project_camera(apply(pose, border), self._camera)

    def _patch(self, pose: FloatArray, low: NDArray[np.int_], high: NDArray[np.int_]) -> Picture:
        """Grey level times coverage, and coverage (h, w, 2) of the board in a part of the image."""
        T_cam_board = self._camera.T_cam_world @ pose
        rows, columns = (high - low)[::-1]
        steps = [
            (low[axis] + (np.arange(count * _SAMPLES) + 0.5) / _SAMPLES - 0.5).astype(np.float32)
            for axis, count in ((0, columns), (1, rows))
        ]
        u, v = np.meshgrid(*steps)
        plane = cv2.remap(self._plane, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        to_board = np.linalg.inv(T_cam_board[:3, [0, 1, 3]])
        a, b = cv2.split(plane)
        x, y, w = (float(p) * a + float(q) * b + float(r) for p, q, r in to_board)
        square = self._board.square_m
        # Pixels that look along the board see it nowhere.
        w = np.where(np.abs(w) < _ALONG, np.float32(_ALONG), w)
        across = x / w / square + (1.0 + MARGIN)
        down = (self._board.rows - 1.0 + MARGIN) - y / w / square
        level = self._level(float(np.linalg.norm(T_cam_board[:3, 3])))
        texels = _SQUARE_PX / 2.0**level
        grey = cv2.remap(
            self._prints[level],
            across * texels - 0.5,
            down * texels - 0.5,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        facing = float(T_cam_board[:3, 2] @ T_cam_board[:3, 3])
        towards = -facing / float(np.linalg.norm(T_cam_board[:3, 3]))
        # The back is plain; the front is darker at a flat angle.
        grey = grey * (0.75 + 0.25 * towards) if facing < 0.0 else np.full_like(grey, _BACK)
        inside = (
            (across >= 0.0)
            & (across <= self._board.columns + 2.0 * MARGIN)
            & (down >= 0.0)
            & (down <= self._board.rows + 2.0 * MARGIN)
        ).astype(np.float32)
        drawn = cv2.merge([grey * inside, inside])
        size = (int(columns), int(rows))
        return np.asarray(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA), np.float32)

    def _level(self, distance_m: float) -> int:
        """Level of the print whose texels are about as large as a sample."""
        samples = float(self._camera.matrix[0, 0]) / distance_m * self._board.square_m * _SAMPLES
        return int(np.clip(np.floor(np.log2(_SQUARE_PX / max(samples, 1e-3))), 0, _LEVELS))


def _undistorted(camera: CameraModel) -> Picture:
    """Positions (h, w, 2) of the pixels on the plane at focal length 1, without the lens.

    Fixed point iteration on the lens model; converges for lenses of less than some 30 %.
    """
    width, height = camera.size_px
    k1, k2, p1, p2, k3 = camera.distortion
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    b_seen = (v - camera.matrix[1, 2]) / camera.matrix[1, 1]
    a_seen = (u - camera.matrix[0, 2] - camera.matrix[0, 1] * b_seen) / camera.matrix[0, 0]
    a, b = a_seen.copy(), b_seen.copy()
    for _ in range(_ITERATIONS):
        r2 = a * a + b * b
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        a, b = (
            (a_seen - 2.0 * p1 * a * b - p2 * (r2 + 2.0 * a * a)) / radial,
            (b_seen - p1 * (r2 + 2.0 * b * b) - 2.0 * p2 * a * b) / radial,
        )
    return np.dstack([a, b]).astype(np.float32)
