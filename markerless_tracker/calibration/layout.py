"""Start values of a rig: poses of the cameras, from views of the board that pairs share."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product

import cv2
import numpy as np

from markerless_tracker.calibration.detect import Seen
from markerless_tracker.calibration.intrinsics import Lens, board_poses
from markerless_tracker.calibration.views import BoardViews
from markerless_tracker.errors import CalibrationError
from markerless_tracker.geometry import FloatArray, apply, inverse, transform

_ANGLE, _LENGTH = 0.12, 0.10
_MOST_SHARED = 40
_LEAST_SUPPORT = 0.34
_MANY_SHARED = 4
_BIG = 0.2

Candidates = list[FloatArray]
"""Poses `T_cam_board` (4, 4) that explain a view."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Start values of cameras and boards.

    Attributes:
        T_cam_world: camera -> (4, 4); the world is the board's frame in the first set.
        T_world_board: (4, 4) of every set.
        orders: per set, camera -> number among the board's symmetries.
    """

    T_cam_world: Mapping[str, FloatArray]
    T_world_board: tuple[FloatArray, ...]
    orders: tuple[Mapping[str, int], ...]


@dataclass(frozen=True, eq=False)
class _Link:
    """How two cameras stand to each other: `T_a_b`, and the number of sets that agree."""

    T_a_b: FloatArray
    support: int
    shared: int


def start_layout(views: BoardViews, lenses: Mapping[str, Lens]) -> Layout:
    """Cameras and boards in the frame of the board on the floor.

    Every shared view gives several relative poses of two cameras (`board_poses`); the one that most
    views agree on is taken. Pairs are chained along the tree of best support.

    Raises:
        CalibrationError: cameras share no view with the others, or contradict them.
    """
    names = list(lenses)
    candidates = [
        {n: board_poses(s, views.board, lenses[n]) for n, s in seen.items() if n in lenses}
        for seen in views.sets
    ]
    candidates = [{n: c for n, c in poses.items() if c} for poses in candidates]
    links: dict[tuple[str, str], _Link] = {}
    for a, b in combinations(names, 2):
        shared = [i for i, poses in enumerate(candidates) if a in poses and b in poses]
        if shared:
            links[a, b] = _link([(candidates[i][a], candidates[i][b]) for i in shared])
    placed = _chained(names, links)
    boards, orders = [], []
    for seen, poses in zip(views.sets, candidates, strict=True):
        pose, chosen = _board(views, seen, poses, placed, lenses)
        boards.append(pose)
        orders.append(chosen)
    T_floor_root = inverse(boards[0])
    return Layout(
        {n: T @ boards[0] for n, T in placed.items()},
        tuple(T_floor_root @ board for board in boards),
        tuple(orders),
    )


def _link(pairs: list[tuple[Candidates, Candidates]]) -> _Link:
    """The relative pose that most shared views agree on."""
    step = max(1, len(pairs) // _MOST_SHARED)
    chosen = pairs[::step]
    relative, view, depth = [], [], []
    for number, (of_a, of_b) in enumerate(chosen):
        for T_a_board, T_b_board in product(of_a, of_b):
            relative.append(T_a_board @ inverse(T_b_board))
            view.append(number)
            depth.append(0.5 * (T_a_board[2, 3] + T_b_board[2, 3]))
    poses, views = np.array(relative), np.array(view)
    scale = _LENGTH * float(np.median(depth))
    cosine = 0.5 * (np.einsum("iab,jab->ij", poses[:, :3, :3], poses[:, :3, :3]) - 1.0)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    far = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=2)
    near = np.maximum(angle / _ANGLE, far / scale) < 1.0
    support = np.array([len(set(views[row])) for row in near])
    best = int(np.argmax(support))
    agreeing = poses[near[best]]
    u, _, v = np.linalg.svd(agreeing[:, :3, :3].sum(axis=0))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    mean = transform(rotation, np.median(agreeing[:, :3, 3], axis=0))
    return _Link(mean, int(support[best]), len(chosen))


def _chained(names: list[str], links: Mapping[tuple[str, str], _Link]) -> dict[str, FloatArray]:
    """`T_cam_root` (4, 4) of every camera, by the strongest links."""
    weight = {n: sum(x.support for pair, x in links.items() if n in pair) for n in names}
    root = max(names, key=lambda n: weight[n])
    placed = {root: np.eye(4)}
    while len(placed) < len(names):
        ahead = [
            (link, a, b)
            if a in placed
            else (_Link(inverse(link.T_a_b), link.support, link.shared), b, a)
            for (a, b), link in links.items()
            if (a in placed) != (b in placed)
        ]
        if not ahead:
            alone = [n for n in names if n not in placed]
            raise CalibrationError(
                f"{', '.join(alone)} share no view of the board with {', '.join(placed)}: hold it "
                "where cameras of both groups see it"
            )
        link, a, b = max(ahead, key=lambda entry: entry[0].support)
        if link.shared >= _MANY_SHARED and link.support < _LEAST_SUPPORT * link.shared:
            raise CalibrationError(
                f"{b} contradicts the other cameras: it shares {link.shared} views of the board "
                f"with {a}, and {link.support} of them agree on where it stands; are its images "
                "mirrored, or not in step?"
            )
        placed[b] = inverse(link.T_a_b) @ placed[a]
    return placed


def _board(
    views: BoardViews,
    seen: Mapping[str, Seen],
    poses: Mapping[str, Candidates],
    placed: Mapping[str, FloatArray],
    lenses: Mapping[str, Lens],
) -> tuple[FloatArray, dict[str, int]]:
    """`T_root_board` (4, 4) of a set that fits all its cameras best, and the order in each."""
    best: tuple[float, FloatArray, dict[str, int]] | None = None
    first = next(iter(poses), "")
    for name, candidates in poses.items():
        for T_cam_board in candidates:
            T_root_board = inverse(placed[name]) @ T_cam_board
            total, orders = 0.0, {}
            for other in poses:
                errors = _errors(views, seen[other], placed[other] @ T_root_board, lenses[other])
                orders[other] = int(np.argmin(errors))
                total += min(min(errors), _BIG)
            # A symmetric board may be rotated in all cameras: the first one keeps its order.
            if orders[first] == 0 and (best is None or total < best[0]):
                best = (total, T_root_board, orders)
    if best is None:
        raise CalibrationError("a view of the board has no pose: is its size right?")
    return best[1], best[2]


def _errors(views: BoardViews, seen: Seen, T_cam_board: FloatArray, lens: Lens) -> list[float]:
    """Error of a view on the plane at focal length 1, for each order of the board's corners."""
    points = apply(T_cam_board, views.board.corners_m[seen.ids])
    if (points[:, 2] <= 0.0).any():
        return [_BIG] * len(views.board.symmetries)
    plane = points[:, :2] / points[:, 2:]
    flat = cv2.undistortPoints(seen.pixels.reshape(-1, 1, 2), lens.matrix, lens.distortion)
    flat = flat.reshape(-1, 2)
    found = []
    for number, order in enumerate(views.board.symmetries):
        there = flat if number == 0 else flat[order]
        found.append(float(np.sqrt(np.mean(np.sum((there - plane) ** 2, axis=1)))))
    return found
