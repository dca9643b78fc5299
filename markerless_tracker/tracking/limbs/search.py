"""Search of limbs over their whole range, while the rest of the body stays."""

from collections.abc import Callable

import numpy as np

from markerless_tracker.body import BodyModel, markers
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
NEAR_M = 0.10
"""A limb that is drawn nearer than that to its place, at every marker, would return there when
refined."""
LEAST_GAIN = 0.003
"""Least rise of f_s between poses in evidence of their own, which differs a little by chance."""
LEAST_M = 0.05
"""Limbs nearer to where they were, at every marker, are not elsewhere."""
CLOSE = 0.01
"""What costs so much more in undecided evidence may be better in its own."""
_PARENTS, _CHILDREN = 6, 10
_REFINE = (3, (LIMB_M, 0.035))
"""Iterations of the refinement of the best, and truncation (m) of the first and the last."""
_REFINE_FAR = (8, (0.15, 0.035))
"""The same of a pose that nothing was drawn for."""

Aim = Callable[[FloatArray, int], FloatArray]


class LimbSearch:
    """The searches of one frame for limbs that are elsewhere.

    Another pose is refined, all of the body. A limb is taken if that explains the frame better than
    the estimate does, and than the estimate refined as much does: what the rest of the body gains
    is no merit of the limb's.

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
        frame = self._own.undecided
        cost = float(frame.costs(self.pose[None])[0])
        other, other_cost = other_limb(frame, self._recombiner, self.pose, limb, rng, aim, cost)
        better = other_cost < cost - self._least_gain
        if better:
            refined = frame.refined(self.pose[None], *_REFINE)
            better = other_cost < float(frame.costs(refined)[0]) - self._least_gain
        if self._own.differs:
            if other_cost > cost + CLOSE or _apart_m(self._own.body, other, self.pose) < LEAST_M:
                return False
            other, other_cost = self._own.refined(other, *_REFINE)
            least_gain = 0.0 if better else LEAST_GAIN
            better = other_cost < self.own_cost - least_gain
            better = better and other_cost < self._own.refined(self.pose, *_REFINE)[1] - least_gain
        if better:
            self._take(other, other_cost)
        return better

    def takes(self, other: FloatArray, least_gain: float, close: float) -> bool:
        """Take another pose (p,) if f_s rises by `least_gain`; other arguments as `compared`."""
        found, gain = self.compared(other, close)
        if gain < least_gain:
            return False
        self._take(found, None)
        return True

    def compared(self, other: FloatArray, close: float) -> tuple[FloatArray, float]:
        """Another pose (p,), refined, and by how much its f_s exceeds that of the estimate.

        Args:
            other: the pose, which may be far from the estimate.
            close: it is compared in evidence of its own if it costs at most so much more than the
                estimate in the evidence that was decided for that.
        """
        refined = self._frame.refined(other[None], *_REFINE_FAR)
        costs = self._frame.costs(np.concatenate([self.pose[None], refined]))
        if not self._own.differs or costs[1] > costs[0] + close:
            return refined[0], float(costs[0] - costs[1])
        found, cost = self._own.refined(refined[0], *_REFINE)
        return found, self.own_cost - cost

    def _take(self, pose: FloatArray, cost: float | None) -> None:
        self.pose = pose
        self._known_cost = cost

    @property
    def own_cost(self) -> float:
        """1 - f_s of the estimate in its own evidence."""
        if self._known_cost is None:
            self._known_cost = self._own.cost(self.pose)
        return self._known_cost


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
    filter. One contour refinement, of the whole body, then refines the best of all. If that is
    where the limb was, the pose itself is returned, with a cost that is not below `most_cost`.

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
    best_pose = poses[int(costs.argmin())]
    if _apart_m(recombiner.body, best_pose, pose) < NEAR_M:
        return pose, most_cost
    refined = frame.refined(best_pose[None], *_REFINE)
    return refined[0], float(frame.costs(refined)[0])


def _apart_m(body: BodyModel, one: FloatArray, other: FloatArray) -> float:
    """Largest distance of a marker between two poses (p,)."""
    return float(np.linalg.norm(markers(body, one) - markers(body, other), axis=1).max())
