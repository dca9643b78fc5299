"""Joint angles determined by a pose only, near the reported angles.

Reported angles are continuous in time. Near 90 degrees of abduction (gimbal lock) their split of a
rotation between the first and the third angle may differ from that of the pose
(docs/joint-angles.md). Files whose readers move a model by the angles need those of the pose.
"""

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.angles import AngleReader
from markerless_tracker.body.angles.definitions import JOINTS
from markerless_tracker.body.angles.reader import wrapped
from markerless_tracker.geometry import FloatArray

APART_COSINE = 0.7
"""If the second angle's cosine is larger, reported angles equal those of the pose."""


class PoseAngles:
    """The angles of poses, each of both solutions and full turns nearest to given angles.

    Args:
        body: the body.

    Attributes:
        names: (k,) as the result has them.
    """

    def __init__(self, body: BodyModel) -> None:
        self._reader = AngleReader(body)
        self.names = self._reader.names
        column = {name: k for k, name in enumerate(self.names)}
        triples = [j.names for j in JOINTS if all(name in column for name in j.names)]
        # (j, 3) columns of the joints whose three angles are reported; others have one solution.
        self._triples = np.array([[column[n] for n in t] for t in triples], dtype=np.int64)
        self._triples = self._triples.reshape(-1, 3)

    def read(self, pose: FloatArray, near: FloatArray | None = None) -> FloatArray:
        """Angles (k,) of a pose (p,), rad.

        Args:
            pose: the pose.
            near: (k,) the angles to be near to, rad; None = zero.
        """
        self._reader.reset()
        found = np.array(self._reader.read(pose).values_rad)
        close = np.zeros(len(found)) if near is None else near
        own, wanted = found[self._triples], close[self._triples]
        other = own * [1.0, -1.0, 1.0] + np.pi
        far = _off(other - wanted) < _off(own - wanted)
        found[self._triples] = np.where(far[:, None], other, own)
        return np.asarray(close + wrapped(found - close))

    def apart(self, angles: FloatArray) -> FloatArray:
        """(k,) from 1, where angles (k,), rad, are far from a singularity, to 0 at one."""
        found = np.ones(len(angles))
        part = np.minimum(np.abs(np.cos(angles[self._triples[:, 1]])) / APART_COSINE, 1.0)
        found[self._triples] = (part * part * (3.0 - 2.0 * part))[:, None]
        return found


def _off(angles: FloatArray) -> FloatArray:
    return np.asarray((wrapped(angles) ** 2).sum(axis=1))
