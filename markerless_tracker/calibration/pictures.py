"""Pictures of a calibration: where each camera saw the board, and the cameras from above."""

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.calibration.bundle import Bundle
from markerless_tracker.calibration.measures import CameraMeasures, cells_seen
from markerless_tracker.camera import CameraRig
from markerless_tracker.geometry import FloatArray, apply

Image = NDArray[np.uint8]

_SIDE_PX, _MARGIN_PX = 900, 90
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_INK, _LIGHT, _BLUE, _RED, _GREEN = (
    (40, 40, 40), (215, 215, 215), (170, 90, 20), (40, 40, 210), (60, 150, 60),
)  # fmt: skip
_ARROWS = 8.0
"""Errors are drawn this much larger than they are."""
_RAY_M = 1.2
_GRID_M = 1.0
_ABOVE_PX, _BELOW_PX = 12, 24
"""Baseline of a camera's name, from the camera."""


def coverage_picture(bundle: Bundle, camera: str, measures: CameraMeasures) -> Image:
    """Corners (h, w, 3) that a camera saw, with their errors enlarged; unseen cells are red."""
    number = bundle.rig.names.index(camera)
    width, height = bundle.rig[camera].size_px
    mine = bundle.camera == number
    picture = np.full((height, width, 3), 250, dtype=np.uint8)
    counts = cells_seen(bundle.seen_px[mine], (width, height))
    rows, columns = counts.shape
    for row, column in zip(*np.nonzero(counts == 0), strict=True):
        low = (int(column * width / columns), int(row * height / rows))
        high = (int((column + 1) * width / columns) - 1, int((row + 1) * height / rows) - 1)
        cv2.rectangle(picture, low, high, (225, 225, 255), cv2.FILLED)
    for seen, error, used in zip(
        bundle.seen_px[mine], bundle.error_px[mine], bundle.used[mine], strict=True
    ):
        colour = _BLUE if used else _RED
        cv2.circle(picture, _pixel(seen), 2, colour, cv2.FILLED, cv2.LINE_AA)
        if used:
            cv2.line(picture, _pixel(seen), _pixel(seen + _ARROWS * error), _GREEN, 1, cv2.LINE_AA)
    _write(
        picture,
        f"{camera}: {measures.views} views, {100.0 * measures.coverage:.0f} % covered, "
        f"{measures.error_px:.2f} px (errors x{_ARROWS:g})",
        (8, 20),
    )
    return picture


def layout_picture(rig: CameraRig, boards: tuple[FloatArray, ...], outline_m: FloatArray) -> Image:
    """The cameras from above (h, w, 3): x to the right, y up, a line per metre.

    Args:
        rig: the cameras.
        boards: `T_world_board` of the poses of the board; the first lies on the floor.
        outline_m: (4, 3) its corners, board frame.
    """
    centres = np.array([camera.T_world_cam[:2, 3] for camera in rig])
    shown = np.concatenate([centres, *(apply(pose, outline_m)[:, :2] for pose in boards)])
    low, high = shown.min(axis=0) - 0.5, shown.max(axis=0) + 0.5
    scale = (_SIDE_PX - 2 * _MARGIN_PX) / float((high - low).max())
    size = np.ceil((high - low) * scale).astype(int) + 2 * _MARGIN_PX
    picture = np.full((size[1], size[0], 3), 255, dtype=np.uint8)

    def place(point: FloatArray) -> tuple[int, int]:
        x, y = (np.asarray(point)[:2] - low) * scale
        return round(float(x)) + _MARGIN_PX, size[1] - _MARGIN_PX - round(float(y))

    for x in np.arange(np.ceil(low[0]), high[0] + 1e-9, _GRID_M):
        cv2.line(picture, place(np.array([x, low[1]])), place(np.array([x, high[1]])), _LIGHT, 1)
    for y in np.arange(np.ceil(low[1]), high[1] + 1e-9, _GRID_M):
        cv2.line(picture, place(np.array([low[0], y])), place(np.array([high[0], y])), _LIGHT, 1)
    for number, pose in enumerate(boards):
        corners = np.array([place(point) for point in apply(pose, outline_m)], dtype=np.int32)
        colour, thick = (_INK, 2) if number == 0 else ((225, 205, 180), 1)
        cv2.polylines(picture, [corners.reshape(-1, 1, 2)], True, colour, thick, cv2.LINE_AA)
    for axis, colour in ((0, _RED), (1, _GREEN)):
        end = np.eye(3)[axis] * 0.5
        cv2.arrowedLine(picture, place(np.zeros(3)), place(end), colour, 2, cv2.LINE_AA)
        _write(picture, "xy"[axis], place(1.2 * end), colour)
    for camera in rig:
        T_world_cam = camera.T_world_cam
        eye = T_world_cam[:3, 3]
        for u in (0.0, camera.size_px[0] - 1.0):
            ray = np.linalg.inv(camera.matrix) @ np.array([u, 0.5 * camera.size_px[1], 1.0])
            cv2.line(
                picture, place(eye), place(apply(T_world_cam, _RAY_M * ray)), _BLUE, 1, cv2.LINE_AA
            )
        cv2.circle(picture, place(eye), 6, _BLUE, cv2.FILLED, cv2.LINE_AA)
        ahead = place(apply(T_world_cam, np.array([0.0, 0.0, _RAY_M])))
        left, top = place(eye)
        # Behind the camera: not over what it sees.
        behind = _BELOW_PX if ahead[1] < top else -_ABOVE_PX
        _write(picture, f"{camera.name} {eye[2]:.2f} m up", (left - 60, top + behind))
    _write(picture, "from above, one line per metre; the board on the floor is black", (8, 20))
    return picture


def _pixel(point: FloatArray) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))


def _write(
    picture: Image, text: str, at: tuple[int, int], colour: tuple[int, int, int] = _INK
) -> None:
    cv2.putText(picture, text, at, _FONT, 0.45, colour, 1, cv2.LINE_AA)
