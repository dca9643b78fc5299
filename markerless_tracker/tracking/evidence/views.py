"""Decides which views are usable: a blinded camera shows silhouette everywhere, or none at all."""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation

MOST_COVER = 0.6
"""A silhouette that covers a larger fraction of the frame is no person: the light or the camera has
changed."""
IN_FRAME = 0.7
"""A view without silhouette is wrong if at least this fraction of the markers is in its frame."""


class ViewWatch:
    """Leaves out unusable views, and reports when a camera is left out or used again.

    Args:
        rig: the cameras; an attribute, which may be replaced between frames.
    """

    def __init__(self, rig: CameraRig) -> None:
        self.rig = rig
        self._out: dict[str, str] = {}

    def reset(self) -> None:
        """Forget which cameras were left out."""
        self._out = {}

    def usable(
        self,
        observed: Mapping[str, Observation],
        body: BodyModel,
        expected: FloatArray | None,
    ) -> tuple[dict[str, Observation], tuple[str, ...]]:
        """The usable views, and a line for each camera that is left out from now on or used again.

        Args:
            observed: the observations of all cameras.
            body: the tracked body.
            expected: (p,) predicted pose, None if unknown.
        """
        reasons: dict[str, str] = {}
        for camera in self.rig:
            observation = observed.get(camera.name)
            if observation is None:
                reasons[camera.name] = "no image"
                continue
            width, height = observation.size_px
            cover = float(observation.mask.sum()) / (width * height)
            if cover > MOST_COVER:
                reasons[camera.name] = f"silhouette over {cover:.0%} of the frame"
        used = {name: seen for name, seen in observed.items() if name not in reasons}
        empty = [name for name, seen in used.items() if not seen.mask_words.any()]
        # Without silhouette in any view the person has left, and no camera is wrong.
        if expected is not None and len(empty) < len(used):
            points = markers(body, expected)
            for name in empty:
                if self._in_frame(points, name) >= IN_FRAME:
                    reasons[name] = "no person where the other views show one"
                    del used[name]
        return used, self._changes(reasons)

    def _in_frame(self, points: FloatArray, name: str) -> float:
        camera = self.rig[name]
        with np.errstate(invalid="ignore"):
            pixels = project_camera(points, camera)
            inside = (pixels >= 0.0).all(axis=1) & (pixels < camera.size_px).all(axis=1)
        return float(inside.mean())

    def _changes(self, reasons: Mapping[str, str]) -> tuple[str, ...]:
        gone = [name for name in reasons if name not in self._out]
        back = [name for name in self._out if name not in reasons]
        self._out = dict(reasons)
        return (
            *(f"{name}: left out, {reasons[name]}" for name in gone),
            *(f"{name}: taken back" for name in back),
        )


def anybody(used: Mapping[str, Observation]) -> bool:
    """Whether any view shows any silhouette."""
    return any(observation.mask_words.any() for observation in used.values())
