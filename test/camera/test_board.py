"""Boards: corners, symmetries, descriptions."""

from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.camera.board import Board, board_squares, read_board, write_board
from markerless_tracker.errors import ConfigError


def test_corners_begin_at_the_top_left_and_the_origin_is_at_the_bottom_left() -> None:
    board = Board("checkerboard", 5, 4, 0.1)
    corners = board.corners_m
    assert corners.shape == (12, 3) and board.inner == (4, 3)
    np.testing.assert_allclose(corners[0], [0.0, 0.2, 0.0])
    np.testing.assert_allclose(corners[3], [0.3, 0.2, 0.0])
    np.testing.assert_allclose(corners[8], [0.0, 0.0, 0.0])
    np.testing.assert_allclose(board.outline_m[[0, 2], :2], [[-0.1, 0.3], [0.4, -0.1]])


@pytest.mark.parametrize(
    ("squares", "orders"),
    [((8, 5), 1), ((5, 8), 1), ((8, 6), 2), ((7, 5), 2), ((7, 7), 4), ((6, 6), 2)],
)
def test_symmetries_keep_the_colours(squares, orders) -> None:
    """A rotation of the printed squares that gives the same picture, and no other."""
    board = Board("checkerboard", *squares, 0.1)
    columns, rows = squares
    row, column = np.indices((rows, columns))
    black = (row + column) % 2 == 0
    turns = [q for q in range(4) if np.rot90(black, q).shape == black.shape]
    same = [q for q in turns if (np.rot90(black, q) == black).all()]
    assert len(board.symmetries) == len(same) == orders
    grid = np.arange((rows - 1) * (columns - 1)).reshape(rows - 1, columns - 1)
    for order, quarter in zip(board.symmetries, same, strict=True):
        np.testing.assert_array_equal(order, np.rot90(grid, quarter).ravel())


def test_a_description_is_read_as_written(tmp_path: Path) -> None:
    write_board(tmp_path / "board.yaml", Board("charuco", 7, 5, 0.1, 0.075, "5x5_100"))
    assert read_board(tmp_path / "board.yaml") == {
        "type": "charuco", "squares": [7, 5], "square_size": 0.1, "marker_size": 0.075,
        "dictionary": "5x5_100",
    }  # fmt: skip
    (tmp_path / "odd.yaml").write_text("colour: red\n")
    with pytest.raises(ConfigError, match="odd.yaml: expected the keys"):
        read_board(tmp_path / "odd.yaml")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (("circles", 5, 4, 0.1), "board 'circles'"),
        (("checkerboard", 2, 4, 0.1), "board of 2x4 squares"),
        (("checkerboard", 7, 3, 0.1), "board of 7x3 squares, expected 4x4 to 60x60"),
        (("charuco", 3, 3, 0.1, 0.05, "4x4_50"), "board of 3x3 squares, expected 4x3 to 60x60"),
        (("checkerboard", 5, 4, 100.0), "metres, not millimetres"),
        (
            ("charuco", 5, 4, 0.1, 0.2, "4x4_50"),
            "marker size 0.2 m, expected 0.02 m to less",
        ),
        (("charuco", 12, 9, 0.1, 0.05, "4x4_50"), "4x4_50 has 50 markers, expected the 54 of 12x9"),
        (("charuco", 5, 4, 0.1, 0.05, "9x9"), "dictionary '9x9'"),
    ],
)
def test_impossible_boards_are_refused(values, message) -> None:
    with pytest.raises(ConfigError, match=message):
        Board(*values)


def test_squares_are_columns_and_rows() -> None:
    assert board_squares("10x7") == (10, 7)
    with pytest.raises(ConfigError, match="COLUMNSxROWS"):
        board_squares("10,7")
