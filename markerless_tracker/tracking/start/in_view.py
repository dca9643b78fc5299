"""Whether enough of a body is in view to start from: who comes in at the edge is waited for.

One outline and a hand in another view leave depth, heading and most of the limbs open. A start from
them is wrong and, worse, goes on to fit the body's sections to what is seen.
"""

from collections.abc import Iterable

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraModel, project_camera
from markerless_tracker.geometry import FloatArray

LEAST_IN_VIEW = 0.6
"""Share of the markers in the frames of two cameras: somebody seen from the knees, or the hips, up
is enough."""


def share_in_view(body: BodyModel, pose: FloatArray, cameras: Iterable[CameraModel]) -> float:
    """Share of the markers of a pose (p,) that lie in the frames of two cameras or more."""
    points = markers(body, pose)
    count = np.zeros(len(points), dtype=np.int64)
    for camera in cameras:
        pixels = project_camera(points, camera)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0) & (pixels <= np.array(camera.size_px) - 1.0)
        count += inside.all(axis=1)
    return float((count >= 2).mean())
