"""Axes of exported files: Y up, as in the TRC; file (x, y, z) = world (y, z, x)."""

import numpy as np

from markerless_tracker.geometry import FloatArray

FROM_WORLD = (1, 2, 0)
"""World axis behind each axis of a file."""
ROTATION_FILE_WORLD: FloatArray = np.eye(3)[list(FROM_WORLD)]
"""(3, 3) takes world coordinates to those of a file."""
DESCRIPTION = "Y up; x, y, z of the file = y, z, x of the world"


def to_file(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of the world frame in a file's axes."""
    return np.asarray(vectors[..., list(FROM_WORLD)])
