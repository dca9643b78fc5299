"""What is doubtful about a calibration from a board, although its error may be small."""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.calibration.measures import CameraMeasures, PairMeasures
from markerless_tracker.camera import CameraModel, CameraRig
from markerless_tracker.camera.board import Board
from markerless_tracker.camera.doubts import calibration_doubts

FOCAL_WIDTHS = (0.45, 3.5)
"""Usual focal lengths, in image widths: fields of view of 96 to 16 degrees."""
ASPECT = 0.03
"""Largest usual difference of the two focal lengths of a camera, relative."""
HEIGHTS_M = (0.25, 6.0)
"""Usual heights of cameras above the floor."""
FOCAL_SD = 0.005
"""Largest standard deviation of a focal length without a doubt, relative."""
POSITION_SD_MM = 15.0
"""Largest standard deviation of a camera's position without a doubt."""
ERROR_PX = 1.0
"""Largest error of a camera without a doubt, in images up to 1000 px wide; else in proportion."""
PAIR_RATIO, PAIR_PX = 3.0, 1.0
"""A pair is doubted if its error exceeds `PAIR_RATIO` times the median pair's and `PAIR_PX`."""
COVERAGE = 0.45
"""Least fraction of a camera's image with corners without a doubt about its lens."""
OUTLIERS = 0.15
"""Largest fraction of a camera's corners that are outliers without a doubt."""
LENS = 0.25
"""Largest usual displacement by the lens in the image's corner, relative to its distance from the
middle."""


def board_doubts(
    board: Board,
    rig: CameraRig,
    cameras: Mapping[str, CameraMeasures],
    pairs: Mapping[tuple[str, str], PairMeasures],
) -> tuple[str, ...]:
    """A line for each thing that is unusual; empty if nothing is."""
    found = [text for camera in rig for text in _camera(camera, cameras[camera.name])]
    found += _pairs(pairs)
    found += _heights(rig)
    if len(board.symmetries) > 1:
        found.append(
            f"{board.describe()} looks the same upside down: the world may be turned by half a "
            "turn; boards with an odd sum of columns and rows do not"
        )
    return (*calibration_doubts(rig), *found)


def _camera(camera: CameraModel, measures: CameraMeasures) -> list[str]:
    name, width = camera.name, camera.size_px[0]
    fx, fy = float(camera.matrix[0, 0]), float(camera.matrix[1, 1])
    found = []
    low, high = FOCAL_WIDTHS
    if not low <= fx / width <= high:
        angle = np.degrees(2.0 * np.arctan(0.5 * width / fx))
        found.append(
            f"focal length {fx:.0f} px for images {width} px wide ({angle:.0f} degrees), expected "
            f"{low * width:.0f} to {high * width:.0f}: show the board larger and tilted"
        )
    if abs(fx / fy - 1.0) > ASPECT:
        found.append(
            f"focal lengths {fx:.0f} and {fy:.0f} px across and down, expected equal ones: are the "
            "images stretched?"
        )
    if measures.focal_sd > FOCAL_SD:
        found.append(
            f"focal length known to {100.0 * measures.focal_sd:.1f} % only: show the board "
            "nearer to it, tilted to all sides"
        )
    if measures.position_sd_mm > POSITION_SD_MM:
        found.append(
            f"position known to {measures.position_sd_mm:.0f} mm only, relative to the board on "
            "the floor: lay a larger board, or show it in more places seen by several cameras"
        )
    if measures.error_px > ERROR_PX * max(1.0, width / 1000.0):
        found.append(
            f"error {measures.error_px:.2f} px: is the board flat and held still, are the cameras "
            "in step?"
        )
    if measures.coverage < COVERAGE:
        found.append(
            f"corners in {100.0 * measures.coverage:.0f} % of its image only: the lens is unknown "
            "elsewhere; show the board at the image's borders, too"
        )
    seen = measures.corners + measures.outliers
    if measures.outliers > OUTLIERS * seen:
        found.append(f"{measures.outliers} of {seen} corners contradict the rest and were left out")
    bend = _lens_at_corner(camera)
    if bend > LENS:
        found.append(
            f"the lens moves the image's corner by {100.0 * bend:.0f} % of its distance from the "
            "middle: a fisheye, or too few views near the border"
        )
    return [f"calibration: {name}: {text}" for text in found]


def _lens_at_corner(camera: CameraModel) -> float:
    half = 0.5 * np.array(camera.size_px) / np.diag(camera.matrix)[:2]
    r2 = float(half @ half)
    k1, k2, k3 = camera.distortion[[0, 1, 4]]
    return abs(float(r2 * (k1 + r2 * (k2 + r2 * k3))))


def _pairs(pairs: Mapping[tuple[str, str], PairMeasures]) -> list[str]:
    if len(pairs) < 2:
        return []
    usual = float(np.median([pair.error_px for pair in pairs.values()]))
    return [
        f"calibration: {a} and {b} contradict each other: {pair.error_px:.2f} px, other pairs "
        f"{usual:.2f} px; are they in step?"
        for (a, b), pair in pairs.items()
        if pair.error_px > max(PAIR_RATIO * usual, PAIR_PX)
    ]


def _heights(rig: CameraRig) -> list[str]:
    low, high = HEIGHTS_M
    heights = {camera.name: float(camera.T_world_cam[2, 3]) for camera in rig}
    if all(z < 0.0 for z in heights.values()):
        return [
            "calibration: all cameras are below the board that should lie on the floor: did it lie "
            "there print up, in the frames taken for the floor (--floor-frame)?"
        ]
    odd = [f"{n} {z:.2f} m" for n, z in heights.items() if z > high or 0.0 <= z < low]
    if not odd:
        return []
    return [
        f"calibration: unusual heights above the floor: {', '.join(odd)}, expected {low:g} to "
        f"{high:g} m: is the square size right, and did the board lie on the floor?"
    ]
