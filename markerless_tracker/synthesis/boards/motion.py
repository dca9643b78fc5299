"""The path of a board: on the floor, near every camera, through the common view."""

import numpy as np

from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.camera.board import Board
from markerless_tracker.geometry import (
    FloatArray,
    rodrigues_from_rotation,
    rotation_from_rodrigues,
    transform,
)

FLOOR_SHARE = 0.06
"""Part of the recording, at its start, in which the board lies on the floor."""
HOLD = 0.5
"""Part of the time at which the board is held still in a pose; it moves between them."""
_PLACES = ((0, 0), (-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (0, 0), (0, 1))
"""Where the board is shown in an image: -1 left or top, 1 right or bottom."""
_SPANS = (0.75, 0.55, 0.55, 0.55, 0.55, 0.60, 0.75, 0.60)
"""Length of the board, in image widths."""
_TILTS = (0.75, 0.65, 0.75, 0.65, 0.75, 0.85, 0.80, 0.85)
_BORDER = 0.02
_CENTRES_M = (
    (0.0, 0.0, 0.9),
    (0.5, 0.3, 1.1),
    (-0.5, 0.4, 0.7),
    (0.3, -0.5, 1.2),
    (-0.4, -0.4, 1.0),
)
_ELEVATIONS = (0.9, 0.55, 1.1, 0.75)
_AROUND = 24
_LOWEST_M = 0.15


class BoardMotion:
    """Poses of a board over a recording.

    Args:
        board: the board.
        rig: the cameras that it is shown to.
        seconds: duration of the recording.
        seed: of small deviations.
    """

    def __init__(self, board: Board, rig: CameraRig, seconds: float, seed: int) -> None:
        rng = np.random.default_rng([seed, 7])
        self._board, self._seconds = board, seconds
        shown = [pose for camera in rig for pose in self._near(camera, rng)]
        self.poses = [np.eye(4), *shown, *self._turning(rng)]
        """`T_world_board` (4, 4) of the poses in which the board is held."""

    def pose(self, time_s: float) -> FloatArray:
        """`T_world_board` (4, 4) at a time."""
        floor_s = FLOOR_SHARE * self._seconds
        if time_s <= floor_s:
            return self.poses[0]
        count = len(self.poses) - 1
        place = min((time_s - floor_s) / (self._seconds - floor_s), 1.0) * count
        step = min(int(place), count - 1)
        share = min(max((place - step) / (1.0 - HOLD), 0.0), 1.0)
        share = share * share * (3.0 - 2.0 * share)
        before, after = self.poses[step], self.poses[step + 1]
        turned = rodrigues_from_rotation(before[:3, :3].T @ after[:3, :3])
        rotation = before[:3, :3] @ rotation_from_rodrigues(share * turned)
        middle = self._middle(before) + share * (self._middle(after) - self._middle(before))
        return self._placed(rotation, middle, 0.0)

    def _near(self, camera: CameraModel, rng: np.random.Generator) -> list[FloatArray]:
        """Poses that fill the parts of a camera's image, tilted in several directions."""
        width, height = camera.size_px
        length, across = self._board.columns * self._board.square_m, self._board.rows
        poses = []
        for i, ((right, down), span) in enumerate(zip(_PLACES, _SPANS, strict=True)):
            depth = camera.matrix[0, 0] * length / (span * width)
            # The inner corners stay inside the image, whatever the tilt.
            room_u = max(0.5 - 0.5 * span - _BORDER, 0.0) * width
            tall = span * width * across / self._board.columns
            room_v = max(0.5 * height - 0.5 * tall - _BORDER * height, 0.0)
            pixel = np.array([0.5 * width + right * room_u, 0.5 * height + down * room_v, 1.0])
            ray = np.linalg.inv(camera.matrix) @ pixel
            about = 2.0 * np.pi * (i * 0.382 + 0.1) + rng.uniform(-0.2, 0.2)
            tilt = _TILTS[i] * np.array([np.cos(about), np.sin(about), 0.0])
            # Seen upright: the board's y is up, its z towards the camera.
            upright = np.diag([1.0, -1.0, -1.0])
            rotation = rotation_from_rodrigues(tilt) @ upright
            placed = camera.T_world_cam @ transform(rotation, depth * ray)
            poses.append(self._placed(placed[:3, :3], placed[:3, 3]))
        return poses

    def _turning(self, rng: np.random.Generator) -> list[FloatArray]:
        """Poses in the common view; the print looks up, and around."""
        poses = []
        for i in range(_AROUND):
            azimuth = 2.0 * np.pi * i / _AROUND * 3.0 + rng.uniform(-0.1, 0.1)
            elevation = _ELEVATIONS[i % len(_ELEVATIONS)]
            normal = np.array(
                [
                    np.cos(elevation) * np.cos(azimuth),
                    np.cos(elevation) * np.sin(azimuth),
                    np.sin(elevation),
                ]
            )
            across = np.cross([0.0, 0.0, 1.0], normal)
            across /= np.linalg.norm(across)
            rotation = np.column_stack([across, np.cross(normal, across), normal])
            rotation = rotation @ rotation_from_rodrigues([0.0, 0.0, rng.uniform(-0.4, 0.4)])
            poses.append(self._placed(rotation, np.array(_CENTRES_M[i % len(_CENTRES_M)])))
        return poses

    def _placed(
        self, rotation: FloatArray, middle: FloatArray, lowest_m: float = _LOWEST_M
    ) -> FloatArray:
        """The pose with the board's middle at a point, above the floor.

        A board that would be in the floor is lifted until its lowest corner has the height
        `lowest_m`; without a jump only for 0.
        """
        pose = transform(rotation, middle - rotation @ self._board.outline_m.mean(axis=0))
        lowest = float((self._board.outline_m @ rotation.T + pose[:3, 3])[:, 2].min())
        pose[2, 3] += lowest_m - lowest if lowest < 0.0 else 0.0
        return pose

    def _middle(self, pose: FloatArray) -> FloatArray:
        return np.asarray(pose[:3, :3] @ self._board.outline_m.mean(axis=0) + pose[:3, 3])
