"""What the searches of a frame for limbs and headings found."""

from dataclasses import dataclass

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray

RECOVERED_M = 0.10
"""A limb that is found farther than this from its last place was wrong there."""


@dataclass(frozen=True, eq=False)
class Recovered:
    """Result of the searches of a frame.

    Attributes:
        pose: (p,) the estimate.
        names: of the limbs that were found elsewhere; `legs` or `arms` for an exchanged pair.
        rotated: whether another heading was found; no parameter continues its last value then.
        searched: whether poses were compared, or limbs drawn and compared, which takes long.
        moved_m: largest distance by which the searches moved a marker; 0 if `rotated`.
    """

    pose: FloatArray
    names: tuple[str, ...] = ()
    rotated: bool = False
    searched: bool = False
    moved_m: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages for the user, one line each."""
        if self.rotated:
            return ("the person faces another way: turned round",)
        return tuple(f"{name}: found elsewhere" for name in self.names)

    def jumped(self, body: BodyModel) -> IntArray:
        """Indices of the parameters that do not continue those of the last frame."""
        if self.rotated:
            return np.arange(body.size)
        return np.array([i for name in self.names for i in body.subspaces[name]], dtype=np.int64)

    def placed(self, body: BodyModel, limits: FloatArray, corrected: FloatArray) -> FloatArray:
        """The pose (p,), within limits except for limbs that were wrong.

        Args:
            body: the body.
            limits: (2, p) of the parameters that continue those of the last frame.
            corrected: (2, p) of limbs that were found elsewhere, but nearer than `RECOVERED_M`.
        """
        pose, jumped = np.clip(self.pose, *limits), self.jumped(body)
        pose[jumped] = self.pose[jumped]
        if not self.rotated and self.moved_m <= RECOVERED_M:
            pose[jumped] = np.clip(pose, *corrected)[jumped]
        return np.asarray(pose)
