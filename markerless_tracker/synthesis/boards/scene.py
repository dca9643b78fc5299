"""A synthetic board in front of synthetic cameras, frame by frame."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.board import Board
from markerless_tracker.errors import ConfigError
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.boards.motion import BoardMotion
from markerless_tracker.synthesis.boards.picture import BoardView
from markerless_tracker.synthesis.rig import MILD_LENS, check_cameras, ring_rig
from markerless_tracker.synthesis.room import room_picture
from markerless_tracker.synthesis.threads import side_by_side

EXPOSURE_S = 0.008
"""Duration of an exposure: a board that moves is blurred."""
_MOMENTS = 3
_ROOM_M = 7.0
_BOARD = 5


class BoardScene:
    """A moving board; cameras and room are those of `SyntheticScene` with the same arguments.

    The board lies on the floor first: its frame is the world's then.

    Args:
        board: the board.
        cameras: number of cameras, cam01.. .
        size_px: (width, height) of every image.
        fps: frames per second.
        seconds: duration; the motion is fitted into it.
        seed: of motion, room and noise.
        noise: standard deviation of the sensor's noise in grey levels.
        distortion: lens k1 k2 p1 p2 (k3).

    Raises:
        ConfigError: an argument is impossible.
    """

    def __init__(
        self,
        board: Board,
        *,
        cameras: int = 4,
        size_px: tuple[int, int] = (656, 490),
        fps: float = 10.0,
        seconds: float = 40.0,
        seed: int = 0,
        noise: float = 3.0,
        distortion: Sequence[float] = MILD_LENS,
    ) -> None:
        check_cameras(cameras, size_px, fps, seed, noise)
        if not seconds * fps >= 1.0:
            raise ConfigError(f"{seconds:g} s at {fps:g} fps, expected one frame or more")
        self.board, self.fps, self.seed = board, float(fps), seed
        self.rig: CameraRig = ring_rig(cameras, size_px, distortion=tuple(distortion))
        self.motion = BoardMotion(board, self.rig, seconds, seed)
        self._noise = noise
        self._views = {camera.name: BoardView(board, camera) for camera in self.rig}
        self._rooms = {camera.name: room_picture(camera, _ROOM_M, seed) for camera in self.rig}

    def pose(self, index: int) -> FloatArray:
        """`T_world_board` (4, 4) in the middle of a frame's exposure."""
        return self.motion.pose(index / self.fps)

    def frame(self, index: int) -> dict[str, NDArray[np.uint8]]:
        """Images (h, w, 3) BGR by camera."""
        times = index / self.fps + EXPOSURE_S * np.linspace(-0.5, 0.5, _MOMENTS)
        poses = [self.motion.pose(float(time)) for time in times]
        if all(np.array_equal(pose, poses[0]) for pose in poses):
            poses = poses[:1]
        return self._images(poses, index)

    def held(self, number: int) -> dict[str, NDArray[np.uint8]]:
        """Images by camera of the board held in one of `motion.poses`."""
        return self._images([self.motion.poses[number]], number)

    def _images(self, poses: list[FloatArray], index: int) -> dict[str, NDArray[np.uint8]]:
        def image(numbered: tuple[int, str]) -> NDArray[np.uint8]:
            number, name = numbered
            drawn = self._views[name].draw(self._rooms[name], poses)
            rng = np.random.default_rng([self.seed, _BOARD, number, index])
            noise = np.float32(self._noise) * rng.standard_normal(drawn.shape, dtype=np.float32)
            return np.clip(np.rint(drawn + noise), 0.0, 255.0).astype(np.uint8)

        names = list(self._views)
        return dict(zip(names, side_by_side(image, list(enumerate(names))), strict=True))
