"""From a recording of a board to calibrated cameras."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from markerless_tracker.calibration.bundle import Bundle, adjust
from markerless_tracker.calibration.doubts import board_doubts
from markerless_tracker.calibration.intrinsics import start_lens
from markerless_tracker.calibration.layout import start_layout
from markerless_tracker.calibration.measures import (
    CameraMeasures,
    PairMeasures,
    camera_measures,
    pair_measures,
)
from markerless_tracker.calibration.views import MOST_SETS, BoardViews, find_views
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.board import Board
from markerless_tracker.datasets import Recording
from markerless_tracker.geometry import transform


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibrated cameras, and how well they are known.

    Attributes:
        rig: the cameras. World: that of the board on the floor, with z = 0 on the floor.
        views: the corners it comes from.
        bundle: the adjustment; its world has z = 0 on the print.
        cameras, pairs: errors and uncertainties.
        doubts: a line for each thing that is unusual.
    """

    rig: CameraRig
    views: BoardViews
    bundle: Bundle
    cameras: Mapping[str, CameraMeasures]
    pairs: Mapping[tuple[str, str], PairMeasures]
    doubts: tuple[str, ...]

    @property
    def error_px(self) -> float:
        """Root mean square distance of projected and seen corners."""
        errors = self.bundle.error_px[self.bundle.used]
        return float(np.sqrt((errors**2).sum(axis=1).mean()))

    def as_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "error_px": round(self.error_px, 4),
            "sets": len(self.views.sets),
            "searched": self.views.searched,
            "floor": {
                "frame": self.views.indices[0],
                "sets": self.views.floor_sets,
                "cameras": list(self.views.sets[0]),
            },
            "cameras": {
                camera.name: {
                    "size": list(camera.size_px),
                    "focal_px": [round(float(camera.matrix[i, i]), 3) for i in (0, 1)],
                    "position_m": [round(float(x), 5) for x in camera.T_world_cam[:3, 3]],
                    **_rounded(self.cameras[camera.name]),
                }
                for camera in self.rig
            },
            "pairs": {f"{a} {b}": _rounded(pair) for (a, b), pair in self.pairs.items()},
            "doubts": list(self.doubts),
        }


def calibrate(
    recording: Recording,
    board: Board,
    *,
    most_sets: int = MOST_SETS,
    floor_frame: int | None = None,
    thickness_m: float = 0.0,
    k3: bool = False,
    progress: Callable[[int, int | None], None] | None = None,
    adjusting: Callable[[], None] | None = None,
) -> Calibration:
    """Calibrate the cameras of a recording of a board.

    Args:
        recording: images of the board; its rig is used for names and sizes only.
        board: the board.
        most_sets, floor_frame, progress: see `find_views`.
        thickness_m: height of the print above the floor while the board lies there.
        k3: whether the lens has a third radial coefficient.
        adjusting: called when the search is done and the adjustment begins.

    Raises:
        CalibrationError: cameras saw no board, too few of them, none together with the others, or
            the views determine no camera.
    """
    views = find_views(
        recording, board, most_sets=most_sets, floor_frame=floor_frame, progress=progress
    )
    if adjusting is not None:
        adjusting()
    lenses = {name: start_lens(views, name, k3=k3) for name in recording.rig.names}
    bundle = adjust(views, lenses, start_layout(views, lenses), k3=k3)
    rig = bundle.rig.moved(transform(np.eye(3), [0.0, 0.0, thickness_m]))
    cameras, pairs = camera_measures(bundle), pair_measures(bundle)
    return Calibration(
        rig, views, bundle, cameras, pairs, board_doubts(views.board, rig, cameras, pairs)
    )


def _rounded(measures: CameraMeasures | PairMeasures) -> dict[str, Any]:
    """Four digits of each number; None for one that is not finite, which JSON lacks."""

    def rounded(value: float) -> float | None:
        if isinstance(value, int):
            return value
        return float(f"{value:.4g}") if math.isfinite(value) else None

    return {key: rounded(value) for key, value in vars(measures).items()}
