"""The corners of a board in an image, in the board's own order."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.calibration.charuco import CharucoFinder
from markerless_tracker.calibration.print_fit import TEXELS, Print, plane_of
from markerless_tracker.camera.board import CHARUCO, Board, charuco_board, rotations
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image
from markerless_tracker.imaging.images import grey_of
from markerless_tracker.records import locked

LEAST_CORNERS = 8
"""A ChArUco board is found with this many corners."""
_WIDTH_PX = 1300
_MOST_ENLARGED = 2.0
_WINDOW = 0.4
_WINDOWS_PX = (2, 11)
_SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
_WRONG_CELLS = 1
_SMALLEST = (3, 3)
_CORNER_PX = 0.5
"""OpenCV 4.6 gives corners of ChArUco boards from the corner of the first pixel, not its centre."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Corners of a board in one image.

    Attributes:
        ids: (n,) numbers of the corners, see `Board.corners_m`.
        pixels: (n, 2) their positions (u, v), px.
    """

    ids: NDArray[np.int64]
    pixels: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", locked(self.ids, np.int64))
        object.__setattr__(self, "pixels", locked(self.pixels, float))


class BoardFinder:
    """Finds one board in images.

    Checkerboards are located by OpenCV's sector based search, in images enlarged or shrunk to about
    1300 px; the search alone is up to 1 px off in oblique views. The colours of all squares must be
    those of the board, which also shows its top. The exact places are those of the print.

    Args:
        board: the board.
    """

    def __init__(self, board: Board) -> None:
        self.board = board
        self._orders = rotations(board)
        self._charuco = _charuco_finders(board) if board.kind == CHARUCO else []
        self._print = _checkerboard_print(board)

    def find(self, image: Image) -> Seen | None:
        """The corners in an image (h, w) or (h, w, 3) BGR; None if the board is not found."""
        grey = grey_of(image)
        return self._find_charuco(grey) if self._charuco else self._find_checkerboard(grey)

    def size_in(self, image: Image) -> tuple[int, int] | None:
        """Columns and rows of squares of any checkerboard in an image; None if there is none."""
        grey, _ = _resized(grey_of(image))
        found, _, meta = cv2.findChessboardCornersSBWithMeta(
            grey, _SMALLEST, cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE
        )
        if not found or meta is None:
            return None
        down, across = meta.shape[:2]
        return across + 1, down + 1

    def _find_checkerboard(self, grey: Image) -> Seen | None:
        across, down = self.board.inner
        resized, factor = _resized(grey)
        found, corners = cv2.findChessboardCornersSB(resized, (across, down), flags=0)
        if not found or corners is None or len(corners) != across * down:
            return None
        grid = np.asarray(corners, dtype=np.float64).reshape(down, across, 2)
        grid = (grid + 0.5) / factor - 0.5
        spacing = _spacing(grid)
        half = int(np.clip(_WINDOW * spacing, *_WINDOWS_PX))
        refined = cv2.cornerSubPix(
            grey,
            np.ascontiguousarray(grid.reshape(-1, 1, 2), dtype=np.float32),
            (half, half),
            (-1, -1),
            _SUBPIXEL,
        )
        exact = np.asarray(refined, dtype=np.float64).reshape(down, across, 2)
        if np.linalg.norm(exact - grid, axis=2).max() > max(0.4 * spacing, 1.0):
            return None
        right, below = exact[0, -1] - exact[0, 0], exact[-1, 0] - exact[0, 0]
        if right[0] * below[1] - right[1] * below[0] < 0.0:
            exact = exact[:, ::-1]
        for order, _ in self._orders:
            ordered = exact.reshape(-1, 2)[order].reshape(down, across, 2)
            if _colours_agree(grey, ordered):
                return Seen(np.arange(across * down), self._exact(grey, ordered.reshape(-1, 2)))
        return None

    def _exact(self, grey: Image, pixels: FloatArray) -> FloatArray:
        """Corners (n, 2) by the print around them; unchanged unless all of them look like it."""
        plane = plane_of(self._print.corners, pixels)
        found = None if plane is None else self._print.measured(grey, plane, pixels)
        return pixels if found is None or len(found[0]) < len(pixels) else found[1]

    def _find_charuco(self, grey: Image) -> Seen | None:
        best: Seen | None = None
        for finder in self._charuco:
            found = finder(grey)
            if found is None or len(found[0]) < LEAST_CORNERS:
                continue
            ids, corners = (np.asarray(each) for each in found)
            if best is None or len(ids) > len(best.ids):
                best = Seen(ids.ravel(), corners.reshape(-1, 2).astype(np.float64))
        # Corners of a single row determine no plane.
        if best is None or len(set(best.ids // self.board.inner[0])) < 2:
            return None
        return best if len(set(best.ids % self.board.inner[0])) > 1 else None


def _charuco_finders(board: Board) -> list[Any]:
    """Functions from a grey image to ids and corners; both prints of a board with even rows."""
    aruco: Any = cv2.aruco
    if not hasattr(aruco, "CharucoDetector"):  # OpenCV 4.6
        drawn = charuco_board(board)

        def find(grey: Image) -> tuple[Any, Any] | None:
            markers, names, _ = aruco.detectMarkers(grey, drawn.dictionary)
            if names is None or not len(names):
                return None
            _, corners, ids = aruco.interpolateCornersCharuco(markers, names, grey, drawn)
            return None if ids is None else (ids, corners - _CORNER_PX)

        return [find]
    # Before OpenCV 4.6 the top left square of a board with even rows was white.
    prints = (False, True) if board.rows % 2 == 0 else (False,)
    return [CharucoFinder(board, legacy=legacy).find for legacy in prints]


def _checkerboard_print(board: Board) -> Print:
    across, down = board.inner
    x, y = np.meshgrid(np.arange(1.0, across + 1.0), np.arange(1.0, down + 1.0))
    row, column = np.indices((board.rows * TEXELS, board.columns * TEXELS)) // TEXELS
    picture = np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8)
    return Print(picture, np.column_stack([x.ravel(), y.ravel()]))


def _resized(grey: Image) -> tuple[Image, float]:
    """The image in which the board is searched, and its factor."""
    factor = min(_WIDTH_PX / max(grey.shape), _MOST_ENLARGED)
    if 0.8 < factor < 1.0:
        return grey, 1.0
    how = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_CUBIC
    resized = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=how)
    return np.asarray(resized, dtype=np.uint8), factor


def _spacing(grid: FloatArray) -> float:
    """Least distance of neighbouring corners (rows, columns, 2), px."""
    return min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min()) for axis in (0, 1))


def _colours_agree(grey: Image, grid: FloatArray) -> bool:
    """Whether all squares around corners (rows, columns, 2) alternate, with black at the top left.

    A grid that lies one square beside the board has white border where squares are expected.
    """
    wide = np.concatenate(
        [2 * grid[:, :1] - grid[:, 1:2], grid, 2 * grid[:, -1:] - grid[:, -2:-1]], 1
    )
    wide = np.concatenate([2 * wide[:1] - wide[1:2], wide, 2 * wide[-1:] - wide[-2:-1]], 0)
    corners = np.stack([wide[:-1, :-1], wide[:-1, 1:], wide[1:, :-1], wide[1:, 1:]])
    middles = corners.mean(axis=0)
    # The middle and four points around it, since print and noise are rough.
    points = np.concatenate([middles[None], middles + 0.4 * (corners - middles)])
    samples = cv2.remap(
        grey,
        points[..., 0].reshape(-1, points.shape[2]).astype(np.float32),
        points[..., 1].reshape(-1, points.shape[2]).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    levels = np.asarray(samples, dtype=np.float64).reshape(points.shape[:3]).mean(axis=0)
    height, width = grey.shape
    inside = ((middles > 0.0) & (middles < np.array([width - 1, height - 1]))).all(axis=2)
    row, column = np.indices(levels.shape)
    black = (row + column) % 2 == 0
    if not (inside & black).any() or not (inside & ~black).any():
        return False
    middle = 0.5 * (levels[inside & black].mean() + levels[inside & ~black].mean())
    wrong = inside & ((levels < middle) != black)
    return bool(wrong.sum() <= _WRONG_CELLS)
