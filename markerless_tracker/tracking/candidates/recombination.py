"""New poses from good ones: whole limbs exchanged, mirrored, taken from a posture, or drawn.

A refinement converges to the nearest optimum. A limb's true place is far from a place where it
explains another limb's silhouette, so limbs are changed as a whole and good poses refined.
"""

from functools import cached_property

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.mirror import Mirror, mirror_of
from markerless_tracker.tracking.candidates.postures import joint_sd, postures

_ONE_PART, _KNOWN = 0.35, 0.3
"""Fractions of two kinds of children: one part (a limb, or torso and head) drawn at random; and one
part, or both arms or legs, taken from a known posture or mirrored. The others mix parts."""
_MIRRORED = 0.25
"""Fraction of the second kind that are mirrored."""
_NOISE = 0.3
"""Variation of the second kind, as a fraction of the prior's standard deviations."""
_MIXED = 0.35
"""Fraction of the limbs that a mixed child changes."""
_ROTATED = 0.4
"""Fraction of the mixed children whose root is also rotated."""
_YAW_RAD, _TILT_RAD = 0.5, 0.15
"""Standard deviations of that rotation, about the vertical axis and about the others."""
_FREE_RAD = 2.8
"""Limbs are drawn at most this far from neutral."""
_FEW = 0.3
"""A smaller prior standard deviation (rad) marks a joint that hardly moves (clavicles, thorax).
Such joints are drawn at most this far from neutral."""
_RANK = 0.15
"""Probability of taking a parent, tried in order from the best (geometric distribution)."""


class Recombiner:
    """Makes children of poses of one body.

    Args:
        body: the body.
        limits: (2, p) of the children.

    Attributes:
        body: the body.
    """

    def __init__(self, body: BodyModel, limits: FloatArray) -> None:
        self.body = body
        self._limits = limits
        self._sd = joint_sd(body)
        # Torso and head, and each limb.
        self._parts = [body.subspaces[step[0]] for step in body.steps("six")[1:]]
        radius = np.where(self._sd < _FEW, _FEW, _FREE_RAD)
        self._low = np.maximum(limits[0], body.neutral - radius)
        self._high = np.minimum(limits[1], body.neutral + radius)
        pairs = [body.subspaces[name] for name in ("arms", "legs") if name in body.subspaces]
        self._groups = [*self._parts, *pairs]
        self._yaw = body.index("pelvis_rz")
        self._tilt = [body.index("pelvis_rx"), body.index("pelvis_ry")]

    # `with_limb` and the like need neither of these, and both take milliseconds.
    @cached_property
    def _known(self) -> FloatArray:
        return postures(self.body)

    @cached_property
    def _mirror(self) -> Mirror:
        return mirror_of(self.body)

    def children(self, parents: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Children (count, p) of poses (n, p), the best parent first."""
        out = np.empty((count, self.body.size))
        for child in out:
            child[:] = parents[min(int(rng.geometric(_RANK)) - 1, len(parents) - 1)]
            kind = rng.random()
            if kind < _ONE_PART:
                self._draw(child, self._parts[rng.integers(len(self._parts))], rng)
            elif kind < _ONE_PART + _KNOWN:
                self._take_known(child, self._groups[rng.integers(len(self._groups))], rng)
            else:
                self._mix(child, parents, rng)
        return np.clip(out, self._limits[0], self._limits[1], out=out)

    def with_limb(
        self, pose: FloatArray, limb: IntArray, count: int, rng: np.random.Generator
    ) -> FloatArray:
        """Poses (count, p): a pose with a limb's parameters drawn uniformly."""
        low, high = self._low[limb], self._high[limb]
        out = np.tile(pose, (count, 1))
        out[:, limb] = low + (high - low) * rng.random((count, len(limb)))
        return out

    def with_prior_limb(
        self, pose: FloatArray, limb: IntArray, count: int, rng: np.random.Generator
    ) -> FloatArray:
        """Poses (count, p): a pose with a limb drawn about neutral, with the prior's deviations."""
        poses = np.tile(pose, (count, 1))
        poses[:, limb] = self.body.neutral[limb]
        return self.with_limb_near(poses, limb, 1.0, rng)

    def with_limb_near(
        self, poses: FloatArray, limb: IntArray, fraction: float, rng: np.random.Generator
    ) -> FloatArray:
        """Poses (n, p), each with its limb varied by a fraction of the prior's deviations."""
        out = poses.copy()
        out[:, limb] += fraction * self._sd[limb] * rng.standard_normal((len(poses), len(limb)))
        return np.clip(out, self._limits[0], self._limits[1], out=out)

    def _draw(self, child: FloatArray, limb: IntArray, rng: np.random.Generator) -> None:
        low, high = self._low[limb], self._high[limb]
        child[limb] = low + (high - low) * rng.random(len(limb))

    def _take_known(self, child: FloatArray, limbs: IntArray, rng: np.random.Generator) -> None:
        mirrored = rng.random() < _MIRRORED
        known = self._mirror.of(child) if mirrored else self._known[rng.integers(len(self._known))]
        noise = _NOISE * self._sd[limbs] * rng.standard_normal(len(limbs))
        child[limbs] = known[limbs] + noise

    def _mix(self, child: FloatArray, parents: FloatArray, rng: np.random.Generator) -> None:
        for limb in self._parts:
            if rng.random() > _MIXED:
                continue
            how = rng.integers(4)
            if how == 0:
                child[limb] = parents[rng.integers(len(parents))][limb]
            elif how == 1:
                child[limb] = self._known[rng.integers(len(self._known))][limb]
            elif how == 2:
                child[limb] = self._mirror.of(child)[limb]
            else:
                scale = (0.5, 1.0)[rng.integers(2)]
                child[limb] += scale * self._sd[limb] * rng.standard_normal(len(limb))
        if rng.random() < _ROTATED:
            child[self._yaw] += _YAW_RAD * rng.standard_normal()
            child[self._tilt] += _TILT_RAD * rng.standard_normal(2)
