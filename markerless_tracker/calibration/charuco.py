"""The corners of a ChArUco board in an image, also where most of its markers are too small to read.

OpenCV reads the markers. From these, the search extends to the other corners, neighbours first. All
corners are then refined by comparing the image with the print around them.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.calibration.print_fit import (
    TEXELS,
    Print,
    correlation,
    inside,
    mapped,
    plane_of,
)
from markerless_tracker.camera.board import Board, charuco_board
from markerless_tracker.geometry import FloatArray
from markerless_tracker.imaging import Image

_WIDTH_PX = 2600
_MOST_ENLARGED = 4.0
"""Enlargement for reading the markers: cells of 1 px are read then."""
_SHARPENED = 2.0
"""Gain of unsharp masking (sigma: one pixel) before the markers are read."""
_CORRECTED, _WRONG_IN_BORDER = 1.0, 0.6
_SEEDS = 8
"""Single markers that the search starts from if it fails from all of them."""
_NEAR_SQUARES = 1.6
"""New corners lie nearer than this to known ones, in squares."""
_WINDOW = 0.25
_WINDOW_PX = (2, 44)
"""Half the window in which a corner is searched, in squares, and its limits."""
_MOST_MOVED = 0.3
"""Largest distance of a corner from its expected position, in squares."""
_BENT = 0.15
"""The same from the homography of all corners."""
_ROUNDS = 12
_SUBPIXEL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-3)
_FEWEST = 4
_SAME_MARKERS = 0.6
"""Least correlation over all markers: 0.7 and more in squares of 8 px and more; boards with another
number of columns, which share some markers with the print, have 0.5 at most."""
_CELLS = 8
_MOST_CELLS = 30_000


class CharucoFinder:
    """Finds one ChArUco board in images.

    Args:
        board: the board.
        legacy: whether the top left square is white, as OpenCV printed boards with even rows once.
    """

    def __init__(self, board: Board, *, legacy: bool = False) -> None:
        aruco: Any = cv2.aruco
        drawn = charuco_board(board)
        if legacy:
            drawn.setLegacyPattern(True)
        reading = aruco.DetectorParameters()
        # Wrong readings are found later: by the other markers and by the whole print.
        reading.errorCorrectionRate = _CORRECTED
        reading.maxErroneousBitsInBorderRate = _WRONG_IN_BORDER
        self._detector = aruco.ArucoDetector(drawn.getDictionary(), reading)
        # Unit: squares, from the top left of the print, y down.
        corners = np.asarray(drawn.getChessboardCorners(), dtype=np.float64)[:, :2]
        points = (np.asarray(each, dtype=np.float64)[:, :2] for each in drawn.getObjPoints())
        self._markers = dict(zip(np.ravel(drawn.getIds()).tolist(), points, strict=True))
        size = (board.columns * TEXELS, board.rows * TEXELS)
        self._print = Print(np.asarray(drawn.generateImage(size), dtype=np.uint8), corners)
        self._cells, self._levels = self._marker_cells(board)

    def find(self, grey: Image) -> tuple[NDArray[np.int64], FloatArray] | None:
        """Numbers (n,) of the corners and pixels (n, 2) in an image (h, w); None if not found."""
        factor = float(np.clip(_WIDTH_PX / max(grey.shape), 1.0, _MOST_ENLARGED))
        resized = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        blurred = cv2.GaussianBlur(resized, (0, 0), factor)
        sharp = cv2.addWeighted(resized, 1.0 + _SHARPENED, blurred, -_SHARPENED, 0.0)
        found, names, _ = self._detector.detectMarkers(sharp)
        known = [
            (self._markers[int(name)], np.reshape(pixels, (4, 2)))
            for name, pixels in zip(np.ravel(names) if found else [], found, strict=True)
            if int(name) in self._markers
        ]
        if not known:
            return None
        large = np.asarray(resized, dtype=np.uint8)
        for part in (known, *([one] for one in known[:_SEEDS])):
            points, pixels = (np.concatenate(each) for each in zip(*part, strict=True))
            followed = self._followed(large, points, pixels)
            if followed is None:
                continue
            plane, places = followed
            # Centres of pixels are at whole numbers.
            shrink = np.array([[1.0, 0.0, 0.5 - 0.5 * factor], [0.0, 1.0, 0.5 - 0.5 * factor]])
            plane = np.vstack([shrink, [0.0, 0.0, factor]]) @ plane
            if self._same_markers(grey, plane):
                return self._print.measured(grey, plane, (places + 0.5) / factor - 0.5)
        return None

    def _followed(
        self, image: Image, known: FloatArray, pixels: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """From points (n, 2) of the print and their pixels (n, 2) to all corners.

        Returns:
            The homography (3, 3) from the print to pixels, and the corners' pixels (m, 2), NaN for
            those not seen; None if they cannot be followed.
        """
        plane, count, corners = plane_of(known, pixels), 0, self._print.corners
        seen = np.full_like(corners, np.nan)
        for _ in range(_ROUNDS):
            if plane is None:
                return None
            near = np.linalg.norm(corners[:, None] - known, axis=2).min(axis=1) < _NEAR_SQUARES
            expected, spacing = mapped(plane, corners), self._print.spacing(plane)
            expected = np.where(np.isfinite(seen), seen, expected)
            numbers = np.flatnonzero(near & inside(expected, image))
            if len(numbers) < _FEWEST:
                return None
            side = spacing[numbers]
            half = int(np.clip(_WINDOW * np.median(side), *_WINDOW_PX))
            start = expected[numbers].reshape(-1, 1, 2).astype(np.float32)
            refined = cv2.cornerSubPix(image, start, (half, half), (-1, -1), _SUBPIXEL)
            places = np.asarray(refined, dtype=np.float64).reshape(-1, 2)
            right = np.linalg.norm(places - expected[numbers], axis=1) < _MOST_MOVED * side
            if right.sum() < _FEWEST:
                return None
            known, seen = corners[numbers[right]], np.full_like(corners, np.nan)
            seen[numbers[right]] = places[right]
            # Lenses bend what a homography keeps straight.
            plane = plane_of(known, places[right], max(3.0, _BENT * float(np.median(side))))
            if right.sum() == count:
                break
            count = int(right.sum())
        return None if plane is None else (plane, seen)

    def _same_markers(self, grey: Image, plane: FloatArray) -> bool:
        """Whether the markers that a homography shows in an image are those of the print."""
        pixels = mapped(plane, self._cells)
        seen = inside(pixels, grey)
        if seen.sum() < 0.1 * len(seen):
            return False
        u, v = pixels[seen].astype(np.float32).T
        image = cv2.remap(grey, u.reshape(1, -1), v.reshape(1, -1), cv2.INTER_LINEAR)
        return correlation(np.ravel(image), self._levels[seen]) >= _SAME_MARKERS

    def _marker_cells(self, board: Board) -> tuple[FloatArray, FloatArray]:
        """Places (n, 2) inside the markers, in squares, and their levels (n,) in the print."""
        size = (board.columns * _CELLS, board.rows * _CELLS)
        small = cv2.resize(self._print.picture, size, interpolation=cv2.INTER_AREA)
        x, y = np.meshgrid(*((np.arange(count) + 0.5) / _CELLS for count in size))
        within = np.zeros(x.shape, dtype=bool)
        for points in self._markers.values():
            (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
            within |= (x > left) & (x < right) & (y > top) & (y < bottom)
        # OpenCV samples at most 32767 places at once.
        every = slice(None, None, int(within.sum()) // _MOST_CELLS + 1)
        places, levels = np.column_stack([x[within], y[within]]), small[within]
        return places[every], np.asarray(levels[every], dtype=np.float64)
