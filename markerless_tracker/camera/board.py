"""Calibration boards: checkerboards and ChArUco boards, their corners and symmetries.

Frame of a board: origin at the inner corner at the bottom left of its print, x to the right, y up,
z out of the print. Board lying on the floor, print up: z is up.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray

CHECKERBOARD, CHARUCO = "checkerboard", "charuco"
BOARD_FILE = "board.yaml"
"""Description of the board in the folder of its recording."""
DICTIONARY = "4x4_50"
"""Markers of a ChArUco board unless stated."""
MARKER_SHARE = 0.75
"""Side of a marker in sides of a square unless stated."""


@dataclass(frozen=True)
class Board:
    """A printed board; its top left square is black.

    Attributes:
        kind: `checkerboard` or `charuco`.
        columns, rows: number of squares to the right and down.
        square_m: side of a square, m.
        marker_m: side of a ChArUco marker, m; 0 for a checkerboard.
        dictionary: OpenCV's name of the markers, without `DICT_`; empty for a checkerboard.

    Raises:
        ConfigError: a value is impossible.
    """

    kind: str
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = ""

    def __post_init__(self) -> None:
        if self.kind not in (CHECKERBOARD, CHARUCO):
            raise ConfigError(f"board {self.kind!r}: expected {CHECKERBOARD} or {CHARUCO}")
        # OpenCV finds checkerboards from 3 inner corners a side on.
        least = 4 if self.kind == CHECKERBOARD else 3
        sides = sorted((self.columns, self.rows))
        if sides[0] < least or sides[1] < 4 or sides[1] > 60:
            raise ConfigError(
                f"board of {self.columns}x{self.rows} squares, expected 4x{least} to 60x60"
            )
        if not 0.001 <= self.square_m <= 2.0:
            raise ConfigError(
                f"square size {self.square_m:g} m, expected 0.001 to 2 (metres, not millimetres)"
            )
        if self.kind == CHARUCO:
            if not 0.2 * self.square_m <= self.marker_m < self.square_m:
                raise ConfigError(
                    f"marker size {self.marker_m:g} m, expected {0.2 * self.square_m:g} m to less "
                    f"than a square, {self.square_m:g} m"
                )
            if not hasattr(cv2, "aruco"):
                raise ConfigError(
                    f"this OpenCV ({cv2.__version__}) has no ArUco markers, expected 4.7 or newer, "
                    "or opencv-contrib"
                )
            if not hasattr(cv2.aruco, f"DICT_{self.dictionary.upper()}"):
                raise ConfigError(
                    f"marker dictionary {self.dictionary!r}: unknown, expected a name of OpenCV "
                    "such as 4x4_50, 5x5_100 or 6x6_250"
                )
            self._check_markers()

    def _check_markers(self) -> None:
        name = getattr(cv2.aruco, f"DICT_{self.dictionary.upper()}")
        held = len(cv2.aruco.getPredefinedDictionary(name).bytesList)
        needed = self.columns * self.rows // 2
        if needed > held:
            raise ConfigError(
                f"marker dictionary {self.dictionary} has {held} markers, expected the {needed} of "
                f"{self.columns}x{self.rows} squares or more"
            )

    @property
    def inner(self) -> tuple[int, int]:
        """Number of inner corners to the right and down."""
        return self.columns - 1, self.rows - 1

    @property
    def corners_m(self) -> FloatArray:
        """Inner corners (n, 3), m, board frame: row by row from the top left."""
        across, down = self.inner
        x, y = np.meshgrid(np.arange(across), np.arange(down))
        points = np.column_stack([x.ravel(), down - 1 - y.ravel(), np.zeros(x.size)])
        return np.asarray(points * self.square_m, dtype=np.float64)

    @property
    def outline_m(self) -> FloatArray:
        """Corners (4, 3) of the board, m, board frame: top left, top right, bottom right, ..."""
        across, down = self.columns - 1.0, self.rows - 1.0
        corners = np.array([[-1, down], [across, down], [across, -1], [-1, -1.0]])
        return np.column_stack([corners, np.zeros(4)]) * self.square_m

    @property
    def symmetries(self) -> tuple[NDArray[np.intp], ...]:
        """Orders (n,) of the corners that show the same print after a rotation, identity first.

        A checkerboard with an even sum of columns and rows looks the same upside down.
        """
        if self.kind == CHARUCO:
            return (np.arange(len(self.corners_m)),)
        return tuple(order for order, same in rotations(self) if same)

    def describe(self) -> str:
        """The board in a few words."""
        text = f"{self.kind} of {self.columns}x{self.rows} squares of {self.square_m:g} m"
        if self.kind == CHARUCO:
            text += f", markers {self.dictionary} of {self.marker_m:g} m"
        return text


def rotations(board: Board) -> list[tuple[NDArray[np.intp], bool]]:
    """Orders (n,) of the corners of a board rotated in its plane, and whether the colours agree."""
    across, down = board.inner
    grid = np.arange(across * down).reshape(down, across)
    quarters = range(4) if across == down else (0, 2)
    found = []
    for quarter in quarters:
        # The inner square at the top left has the colour of the board's top left square.
        column, row = [(0, 0), (across, 0), (across, down), (0, down)][quarter]
        found.append((np.rot90(grid, quarter).ravel(), (column + row) % 2 == 0))
    return found


def board_squares(text: str) -> tuple[int, int]:
    """Columns and rows of `CxR`.

    Raises:
        ConfigError: it is not of that form.
    """
    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})", text)
    if match is None:
        raise ConfigError(f"squares {text!r}: expected COLUMNSxROWS such as 10x7")
    return int(match[1]), int(match[2])


def charuco_board(board: Board) -> Any:
    """OpenCV's ChArUco board, in squares (unit: 1 square)."""
    aruco: Any = cv2.aruco
    dictionary = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{board.dictionary.upper()}"))
    size, share = (board.columns, board.rows), board.marker_m / board.square_m
    if hasattr(aruco, "CharucoBoard_create"):  # OpenCV 4.6
        return aruco.CharucoBoard_create(*size, 1.0, share, dictionary)
    return aruco.CharucoBoard(size, 1.0, share, dictionary)


def write_board(path: Path, board: Board) -> None:
    """Write a board's description as YAML."""
    values: dict[str, Any] = {
        "type": board.kind,
        "squares": [board.columns, board.rows],
        "square_size": board.square_m,
    }
    if board.kind == CHARUCO:
        values |= {"marker_size": board.marker_m, "dictionary": board.dictionary}
    path.write_text(yaml.safe_dump(values, sort_keys=False), encoding="utf-8")


def read_board(path: Path) -> dict[str, Any]:
    """The values of a board's description: type, squares, square_size, marker_size, dictionary.

    Raises:
        ConfigError: the file cannot be read, or a key is unknown.
    """
    keys = ("type", "squares", "square_size", "marker_size", "dictionary")
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        first = str(error).splitlines()[0]
        raise ConfigError(f"{path}: cannot read the board: {first}") from error
    if not isinstance(values, dict) or set(values) - set(keys):
        raise ConfigError(f"{path}: expected the keys {', '.join(keys)}")
    return values
