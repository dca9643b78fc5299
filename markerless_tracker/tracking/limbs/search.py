"""Search of limbs over their whole range, while the rest of the body stays."""

from collections.abc import Callable

import numpy as np

from markerless_tracker.body import markers
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.search import LIMB_M
from markerless_tracker.tracking.start.own_evidence import OwnEvidence
from markerless_tracker.tracking.start.population import FramePopulation
from markerless_tracker.tracking.start.recombination import Recombiner

DRAWS = 120
"""First draws of a limb: half from the pose prior, half uniform."""
AIMED, AIMED_OF = 60, 1000
"""Where silhouette is unexplained: further draws of a limb that lies there, the best of so many."""
LAYERS = (0.4, 0.2)
"""Then the best are varied in layers, by these fractions of the prior's standard deviations."""
HOPELESS = 0.03
"""A limb whose cost exceeds the largest useful cost by more than this is not refined."""
LEAST_GAIN = 0.003
"""Least rise of f_s between poses in evidence of their own, which differs a little by chance."""
LEAST_M = 0.05
"""Limbs nearer to where they were, at every marker, are not elsewhere."""
CLOSE = 0.02
"""What costs so much more in the evidence decided for the pose so far may be better in its own."""
_PARENTS, _CHILDREN = 6, 10
_REFINE = (3, (LIMB_M, 0.035))
"""Iterations of the refinement of the best, and truncation (m) of the first and the last."""
_REFINE_FAR = (8, (0.15, 0.035))
"""The same of a pose that nothing was drawn for."""

Aim = Callable[[FloatArray, int], FloatArray]


class LimbSearch:
    """The searches of one frame for limbs that are elsewhere.

    Args:
        recombiner: draws limbs of the body.
        frame: the evidence, decided near the predicted body.
        own: the same for poses that decide it themselves.
        pose: (p,) the estimate.
        least_gain: rise of f_s from which on another pose is taken.

    Attributes:
        pose: (p,) the estimate so far.
    """

    def __init__(
        self,
        recombiner: Recombiner,
        frame: FramePopulation,
        own: OwnEvidence,
        pose: FloatArray,
        least_gain: float,
    ) -> None:
        self._recombiner = recombiner
        self._frame = frame
        self._own = own
        self._least_gain = least_gain
        self._take(pose, None)

    def elsewhere(self, limb: IntArray, rng: np.random.Generator, aim: Aim | None) -> bool:
        """Search a limb's parameters; whether it was found elsewhere. Arguments as `other_limb`."""
        cost = float(self._frame.costs(self.pose[None])[0])
        other, other_cost = other_limb(
            self._frame, self._recombiner, self.pose, limb, rng, aim, cost
        )
        better = other_cost < cost - self._least_gain
        if not self._own.differs:
            if better:
                self._take(other, other_cost)
            return better
        if better and self._own.cost(other) < self.own_cost:
            self._take(other, None)
            return True
        if other_cost > cost + CLOSE or self._moved_m(other) < LEAST_M:
            return False
        return self._takes(other, LEAST_GAIN, CLOSE, _REFINE)

    def takes(self, other: FloatArray, least_gain: float, close: float) -> bool:
        """Refine another pose (p,), and take it if it is better, each in its own evidence.

        Args:
            other: the pose.
            least_gain: rise of f_s from which on it is taken.
            close: largest cost before the refinement, beyond that of the estimate.
        """
        return self._takes(other, least_gain, close, _REFINE_FAR)

    def _takes(
        self,
        other: FloatArray,
        least_gain: float,
        close: float,
        refine: tuple[int, tuple[float, float]],
    ) -> bool:
        if self._own.cost(other) > self.own_cost + close:
            return False
        found, cost = self._own.refined(other, *refine)
        if self._own.differs and cost <= self.own_cost + HOPELESS:
            # Once more, in what the refined body decides.
            found, cost = self._own.refined(found, *_REFINE)
        if cost >= self.own_cost - least_gain:
            return False
        self._take(found, cost)
        return True

    def _take(self, pose: FloatArray, cost: float | None) -> None:
        self.pose = pose
        self._known_cost = cost

    @property
    def own_cost(self) -> float:
        """1 - f_s of the estimate in its own evidence."""
        if self._known_cost is None:
            self._known_cost = self._own.cost(self.pose)
        return self._known_cost

    def _moved_m(self, other: FloatArray) -> float:
        body = self._own.body
        return float(np.linalg.norm(markers(body, other) - markers(body, self.pose), axis=1).max())


def other_limb(
    frame: FramePopulation,
    recombiner: Recombiner,
    pose: FloatArray,
    limb: IntArray,
    rng: np.random.Generator,
    aim: Aim | None = None,
    most_cost: float = np.inf,
) -> tuple[FloatArray, float]:
    """The best pose (p,) that is found with a limb elsewhere, and its cost 1 - f_s.

    Draws are sparse for a limb of six joints, so the best are varied twice, as in an annealed
    filter. One contour refinement, of the whole body, then refines the best of all.

    Args:
        frame: the evidence.
        recombiner: draws limbs of the body.
        pose: (p,) where the rest of the body is.
        limb: the limb's parameters.
        rng: draws.
        aim: of many poses (n, p) keeps at most so many, those whose limb lies where silhouette is
            unexplained; None: no such draws.
        most_cost: largest useful cost; the result matters only below it.
    """
    half = DRAWS // 2
    poses = np.concatenate(
        [
            recombiner.with_prior_limb(pose, limb, half, rng),
            recombiner.with_limb(pose, limb, DRAWS - half, rng),
        ]
    )
    if aim is not None:
        many = [
            recombiner.with_prior_limb(pose, limb, AIMED_OF // 2, rng),
            recombiner.with_limb(pose, limb, AIMED_OF // 2, rng),
        ]
        poses = np.concatenate([poses, aim(np.concatenate(many), AIMED)])
    costs_of = frame.limb_costs(pose, limb)
    costs = costs_of(poses[:, limb])
    for layer, fraction in enumerate(LAYERS, 1):
        best = np.argsort(costs, kind="stable")[:_PARENTS]
        near = recombiner.with_limb_near(
            np.repeat(poses[best], _CHILDREN, axis=0), limb, fraction, rng
        )
        # Of the last layer only the best counts, of the others the parents.
        cutoff = costs[best[0 if layer == len(LAYERS) else -1]]
        poses = np.concatenate([poses[best], near])
        more = costs_of(near[:, limb], np.full(len(near), cutoff))
        costs = np.concatenate([costs[best], more])
    if costs.min() > most_cost + HOPELESS:
        return pose, float(costs.min())
    refined = frame.refined(poses[[int(costs.argmin())]], *_REFINE)
    return refined[0], float(frame.costs(refined)[0])
