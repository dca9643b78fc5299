"""Distances between the body's outline and the silhouettes' edges, and their normal equations.

`ContourFrame` compares one frame with poses; `outline_rows` gives the residuals as rows.
"""

from markerless_tracker.fitness.contour.frame import (
    RADIUS_M,
    SPACING_M,
    ContourFrame,
    NormalEquations,
)
from markerless_tracker.fitness.contour.outline_rows import (
    OutlineRows,
    floor_rows,
    joined_rows,
    length_jacobian,
    outline_rows,
    pose_jacobian,
    surface,
)
from markerless_tracker.fitness.contour.row_kernels import (
    add_pose_prior,
    eliminated,
    normal_equations,
    solved,
)

__all__ = [
    "RADIUS_M",
    "SPACING_M",
    "ContourFrame",
    "NormalEquations",
    "OutlineRows",
    "add_pose_prior",
    "eliminated",
    "floor_rows",
    "joined_rows",
    "length_jacobian",
    "normal_equations",
    "outline_rows",
    "pose_jacobian",
    "solved",
    "surface",
]
