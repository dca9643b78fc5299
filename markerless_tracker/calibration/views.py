"""The board in all cameras over a recording: sets of corners, and the set on the floor."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from markerless_tracker.calibration.detect import BoardFinder, Seen
from markerless_tracker.camera.board import CHARUCO, Board
from markerless_tracker.datasets import FrameSet, Recording
from markerless_tracker.errors import CalibrationError

MOST_SETS = 100
"""Sets of images that are searched for the board, evenly spread, by default."""
STILL = 0.0008
"""A board is static while its corners move by less than this from their first position, in image
widths."""
_SIZE_TRIES = 6


@dataclass(frozen=True, eq=False)
class BoardViews:
    """Where the cameras saw the board.

    Attributes:
        board: the board.
        sizes_px: camera -> (width, height).
        sets: per pose of the board, camera -> its corners; the first set is that on the floor.
        indices: frame of each set; of the floor: its first.
        floor_sets: number of sets in which the board lay on the floor, merged into the first.
        searched: number of sets searched.
    """

    board: Board
    sizes_px: Mapping[str, tuple[int, int]]
    sets: tuple[Mapping[str, Seen], ...]
    indices: tuple[int, ...]
    floor_sets: int
    searched: int

    def of(self, camera: str) -> list[tuple[int, Seen]]:
        """The sets in which a camera saw the board: number, corners."""
        return [(i, seen[camera]) for i, seen in enumerate(self.sets) if camera in seen]


def find_views(
    recording: Recording,
    board: Board,
    *,
    most_sets: int = MOST_SETS,
    floor_frame: int | None = None,
    progress: Callable[[int, int | None], None] | None = None,
) -> BoardViews:
    """Search a recording for the board.

    The board lies on the floor from the first set in which it is found, or from `floor_frame`,
    until it moves. Each corner of these sets gets its median position.

    Args:
        recording: calibrated or not.
        board: the board.
        most_sets: about how many sets are searched.
        floor_frame: a frame in which the board lies on the floor.
        progress: called with the number of sets searched and their expected number.

    Raises:
        CalibrationError: a camera never saw the board, none did at `floor_frame`, or there is no
            such frame.
    """
    frames = recording.frame_count
    if floor_frame is not None and not 0 <= floor_frame < (frames or floor_frame + 1):
        raise _no_frame(recording, floor_frame)
    finder = BoardFinder(board)
    every = max(1, -(-(recording.frame_count or 1) // most_sets))
    total = None if recording.frame_count is None else -(-recording.frame_count // every)
    found: list[tuple[int, dict[str, Seen]]] = []
    kept: list[FrameSet] = []
    searched = 0
    with ThreadPoolExecutor(min(4, len(recording.rig))) as pool:

        def search(frame: FrameSet) -> dict[str, Seen]:
            seen = pool.map(finder.find, frame.images.values())
            return {n: s for n, s in zip(frame.images, seen, strict=True) if s is not None}

        for frame in recording.frames(every=every):
            seen = search(frame)
            searched += 1
            if seen:
                found.append((frame.index, seen))
            elif len(kept) < _SIZE_TRIES and searched % 4 == 1:
                kept.append(frame)
            if progress is not None:
                progress(searched, total)
        if floor_frame is not None:
            on_floor = next(recording.frames(start=floor_frame), None)
            if on_floor is None:
                raise _no_frame(recording, floor_frame)
            seen = search(on_floor)
            if not seen:
                raise CalibrationError(
                    f"{recording.name}: no camera sees the board in frame {floor_frame}, expected "
                    "it on the floor there"
                )
            found = [(i, s) for i, s in found if i != floor_frame] + [(floor_frame, seen)]
            found.sort(key=lambda entry: entry[0])
    _check_all_saw(recording, finder, found, kept, searched)
    first = 0 if floor_frame is None else [i for i, _ in found].index(floor_frame)
    return _with_floor(recording, board, found, first, searched)


def _no_frame(recording: Recording, number: int) -> CalibrationError:
    frames = recording.frame_count
    expected = "one of the recording's" if frames is None else f"0 to {frames - 1}"
    return CalibrationError(f"{recording.name}: no frame {number}, expected {expected}")


def _with_floor(
    recording: Recording,
    board: Board,
    found: list[tuple[int, dict[str, Seen]]],
    first: int,
    searched: int,
) -> BoardViews:
    """The views with the sets on the floor merged into one, which comes first."""
    sizes = {camera.name: camera.size_px for camera in recording.rig}
    lying, floor_views = [first], [found[first][1]]
    for number in range(first + 1, len(found)):
        seen = _aligned(board, found[first][1], found[number][1])
        if not _still(found[first][1], seen, sizes):
            break
        lying.append(number)
        floor_views.append(seen)
    floor = _merged(floor_views)
    rest = [entry for number, entry in enumerate(found) if number not in lying]
    return BoardViews(
        board,
        sizes,
        (floor, *(seen for _, seen in rest)),
        (found[first][0], *(index for index, _ in rest)),
        len(lying),
        searched,
    )


def _aligned(board: Board, first: Mapping[str, Seen], later: Mapping[str, Seen]) -> dict[str, Seen]:
    """Views of a symmetric board in the order that is nearest to that of another set."""
    orders = board.symmetries
    if len(orders) == 1:
        return dict(later)
    aligned = {}
    for name, seen in later.items():
        order = orders[0]
        if name in first:
            before = first[name].pixels
            order = min(orders, key=lambda o: float(np.abs(seen.pixels[o] - before).sum()))
        aligned[name] = Seen(seen.ids, seen.pixels[order])
    return aligned


def _still(
    first: Mapping[str, Seen], later: Mapping[str, Seen], sizes: Mapping[str, tuple[int, int]]
) -> bool:
    """Whether a board has not moved between two sets, in any camera that sees it in both."""
    shared = [name for name in first if name in later]
    for name in shared:
        ids, a, b = np.intersect1d(first[name].ids, later[name].ids, return_indices=True)
        if not len(ids):
            return False
        moved = np.linalg.norm(first[name].pixels[a] - later[name].pixels[b], axis=1)
        if np.median(moved) > STILL * sizes[name][0]:
            return False
    return bool(shared)


def _merged(sets: list[dict[str, Seen]]) -> dict[str, Seen]:
    """Median position of every corner over sets in which the board is static."""
    merged: dict[str, Seen] = {}
    for name in dict.fromkeys(name for seen in sets for name in seen):
        ids = np.concatenate([seen[name].ids for seen in sets if name in seen])
        pixels = np.concatenate([seen[name].pixels for seen in sets if name in seen])
        unique, place = np.unique(ids, return_inverse=True)
        medians = np.array([np.median(pixels[place == k], axis=0) for k in range(len(unique))])
        merged[name] = Seen(unique, medians)
    return merged


def _check_all_saw(
    recording: Recording,
    finder: BoardFinder,
    found: list[tuple[int, dict[str, Seen]]],
    kept: list[FrameSet],
    searched: int,
) -> None:
    blind = [n for n in recording.rig.names if not any(n in seen for _, seen in found)]
    if not blind:
        return
    board = finder.board
    if len(blind) < len(recording.rig):
        raise CalibrationError(
            f"{recording.name}: {', '.join(blind)} saw no board in {searched} images, the other "
            f"cameras did; expected a {board.describe()} in view of every camera"
        )
    wanted = f"{board.columns}x{board.rows}; count the squares, not the corners between them"
    hint = ""
    if board.kind == CHARUCO:
        hint = " (is it printed with these markers, not mirrored, and no checkerboard?)"
        wanted = f"a {board.describe()}{hint}"
    for size in _other_sizes(finder, kept):
        raise CalibrationError(
            f"{recording.name}: found a board of {size[0]}x{size[1]} squares, expected {wanted}"
        )
    raise CalibrationError(
        f"{recording.name}: no camera saw a board in {searched} sets of images, expected a "
        f"{board.describe()}{hint}"
    )


def _other_sizes(finder: BoardFinder, kept: list[FrameSet]) -> Iterator[tuple[int, int]]:
    """Sizes of other boards in images."""
    for frame in kept:
        for image in frame.images.values():
            size = finder.size_in(image)
            if size is not None:
                yield size
