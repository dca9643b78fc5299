"""Search of a limb over its whole range, and comparison of whole poses with the estimate."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, markers
from markerless_tracker.body.kinematics import farthest_moved_m
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.candidates.prior_costs import prior_costs
from markerless_tracker.tracking.candidates.recombination import Recombiner
from markerless_tracker.tracking.limbs.rivals import Rival, rival_of
from markerless_tracker.tracking.search import LIMB_TRUNCATION_M

DRAWS = 120
"""First draws of a limb: half about the neutral posture, half uniform."""
AIMED, AIMED_OF = 60, 1000
"""If silhouette is unexplained: number of further draws that lie in its regions, and of those that
they are selected from."""
LAYERS = (0.4, 0.2)
"""The best draws are varied in layers, by these fractions of the prior's standard deviations."""
HOPELESS = 0.03
"""A limb whose cost exceeds the largest useful cost by more than this is not refined."""
NEAR_M = 0.10
"""A drawn limb with every marker nearer than this to its place would return there when refined."""
LEAST_GAIN = 0.003
"""Least gain between two poses in their own evidence, which differs a little by chance."""
LEAST_M = 0.05
"""A limb with every marker nearer than this to its place was not found elsewhere."""
GAIN_PER_M, FREE_M = 0.01, 0.5
"""The evidence alone, without the prior, must gain `GAIN_PER_M` for each m that a limb is moved
farther than `FREE_M`; nearer, it may lose as much for each m. However unusual a limb's place is, a
limb that was tracked there is seldom far from it."""
CLOSE = 0.01
"""A pose that costs at most this much more in undecided evidence may be better in its own."""
ARMS_SHARE = 0.25
"""Weight of the other pose's evidence where places of an arm are compared. An arm in the trunk
misses nothing in its own evidence, even if the person's arm looks like a shadow. Legs stand in
shadows, which a wrong leg makes person as well, so that evidence does not count for them."""
_PARENTS, _CHILDREN = 3, 10
"""Draws that are varied in each layer: the best by f_s, and as many with the prior, too (many are
the same); and variations of each."""
_REFINE = (3, (LIMB_TRUNCATION_M, 0.035))
"""Iterations of the refinement of the best draw; truncation (m) in the first and the last one."""
_REFINE_FAR = (8, (0.15, 0.035))
"""The same for a given pose, which may be far from the optimum."""

Aim = Callable[[FloatArray, int], FloatArray]


class LimbSearch:
    """The searches of one frame for limbs that are elsewhere.

    After a search of a limb the whole body is refined. The result is taken if it explains the frame
    better than the estimate, and better than the estimate after the same refinement: a gain of the
    rest of the body is not due to the limb. Other whole poses are compared with the estimate alone.
    Poses are compared by `costs_with_prior`; the gain of a pose is how far its cost lies below the
    estimate's; where pixels were undecided, `OwnEvidence.gain`, for arms with `ARMS_SHARE`. The
    evidence alone must gain enough, too (`GAIN_PER_M`).

    Args:
        recombiner: draws limbs of the body.
        frame: the evidence, decided near the predicted body.
        own: the evidence for poses that decide it themselves.
        pose: (p,) the estimate.
        least_gain: least gain for which a limb is taken, in evidence whose undecided pixels do not
            count. If pixels were undecided, a limb with that gain must not cost more in its own
            evidence either, and one without it must gain `LEAST_GAIN` there.
        thorough: as for `drawn_limbs`.

    Attributes:
        pose: (p,) the estimate so far; assigned to take another one.
        rival: the place that the last search of a limb did not take: the best other one, or the
            former one; None if there is none.
    """

    def __init__(
        self,
        recombiner: Recombiner,
        frame: FramePopulation,
        own: OwnEvidence,
        pose: FloatArray,
        least_gain: float,
        *,
        thorough: bool = True,
    ) -> None:
        self._least_gain, self._thorough = least_gain, thorough
        self._recombiner = recombiner
        self._frame = frame
        self._own = own
        self.rival: Rival | None = None
        self.pose = pose

    def drawn(self, limb: IntArray, rng: np.random.Generator, aim: Aim | None) -> FloatArray:
        """The first half of a search; arguments as for `drawn_limbs`."""
        frame = self._own.undecided
        cost = float(frame.costs_with_prior(self.pose[None])[0])
        return drawn_limbs(
            frame, self._recombiner, self.pose, limb, rng, aim, cost, thorough=self._thorough
        )

    def take_drawn(self, limb: IntArray, drawn: FloatArray) -> bool:
        """The second half of a search, in the same frame or a later one: take a limb if it is
        better; return whether it was.

        Args:
            limb: the limb's parameters.
            drawn: (n, d) draws of it, not refined.
        """
        self.rival = None
        if not len(drawn):
            return False
        before = self.pose
        poses = np.tile(before, (len(drawn), 1))
        poses[:, limb] = drawn
        other, gain, better = self._elsewhere(limb, poses)
        if better:
            self.pose = other
            self.rival = rival_of(self._own.body, self.pose, before, gain)
        else:
            self.rival = rival_of(self._own.body, before, other, -gain)
        return better

    def _elsewhere(self, limb: IntArray, poses: FloatArray) -> tuple[FloatArray, float, bool]:
        """The best of other poses (n, p), refined, its gain, and whether that is enough."""
        frame = self._own.undecided
        cost = float(frame.costs_with_prior(self.pose[None])[0])
        other, other_cost = best_refined(frame, poses)
        gain, least_gain = cost - other_cost, self._least_gain
        if gain > least_gain:
            refined = frame.refined(self.pose[None], *_REFINE)
            gain = min(gain, float(frame.costs_with_prior(refined)[0]) - other_cost)
        if self._own.differs:
            if other_cost > cost + CLOSE or distance_m(self._own.body, other, self.pose) < LEAST_M:
                return other, gain, False
            least_gain = 0.0 if gain > least_gain else LEAST_GAIN
            share = ARMS_SHARE if self._is_arm(limb) else 0.0
            other = self._own.refined(other, *_REFINE)
            gain = self._own.gain(self.pose, other, other_share=share)
            if gain > least_gain:
                mine = self._own.refined(self.pose, *_REFINE)
                gain = min(gain, self._own.gain(mine, other, other_share=share))
        better = gain > least_gain and gain > self._least_gain_of(other)
        return other, gain, better

    def _is_arm(self, limb: IntArray) -> bool:
        """Whether a limb is one of the arms."""
        arms = self._own.body.subspaces.get("arms", ())
        return bool(np.isin(limb, arms).all())

    def _least_gain_of(self, other: FloatArray) -> float:
        """Least gain of a pose (p,): the prior's part, and the evidence's own at that distance."""
        here, there = prior_costs(self._own.body, np.stack([self.pose, other]))
        distance = distance_m(self._own.body, other, self.pose)
        return float(here - there) + GAIN_PER_M * (distance - FREE_M)

    def take_if_better(self, other: FloatArray, least_gain: float, close: float) -> bool:
        """Take another pose (p,) if it gains `least_gain`; return whether it was taken.

        Other arguments as for `compared`.
        """
        found, gain = self.compared(other, close)
        if gain < least_gain:
            return False
        self.pose = found
        return True

    def cheapest(self, others: FloatArray) -> int:
        """Which of other poses (n, p) costs least, not refined."""
        return int(self._frame.costs_with_prior(others).argmin()) if len(others) > 1 else 0

    def compared(self, other: FloatArray, close: float) -> tuple[FloatArray, float]:
        """Another pose (p,), refined, and its gain: how much less it costs than the estimate.

        Args:
            other: the pose, which may be far from the estimate.
            close: the poses are compared by `OwnEvidence.gain` if the other costs at most this much
                more in the evidence decided with the predicted pose.
        """
        refined = self._frame.refined(other[None], *_REFINE_FAR)
        costs = self._frame.costs_with_prior(np.concatenate([self.pose[None], refined]))
        if not self._own.differs or costs[1] > costs[0] + close:
            return refined[0], float(costs[0] - costs[1])
        found = self._own.refined(refined[0], *_REFINE)
        return found, self._own.gain(self.pose, found)


def drawn_limbs(
    frame: FramePopulation,
    recombiner: Recombiner,
    pose: FloatArray,
    limb: IntArray,
    rng: np.random.Generator,
    aim: Aim | None = None,
    most_cost: float = np.inf,
    *,
    thorough: bool = True,
) -> FloatArray:
    """The best draws (n, d) of a limb elsewhere, at most two, not refined.

    The draws are sparse for a limb of six joints, so the best ones are varied twice, as in an
    annealed particle filter. They are the best by f_s, and the best if the prior counts, too: where
    the limb explains few pixels, f_s tells little; where people have it seldom, the prior misleads.
    There is none if no draw comes within `HOPELESS` of `most_cost`, or if the best draws of both
    kinds lie near the former place.

    Args:
        frame: the evidence.
        recombiner: draws limbs of the body.
        pose: (p,) the estimate.
        limb: the limb's parameters.
        rng: draws.
        aim: selects, from poses (n, p), at most a given number whose limb lies in unexplained
            silhouette; None for no such draws.
        most_cost: of the estimate, with the prior. Draws that cost `HOPELESS` more, without the
            prior, are not worth a refinement.
        thorough: whether draws near the former place are left out at once. Else they are often the
            best ones, and the search ends, which takes less time.
    """
    body = recombiner.body

    def far(poses: FloatArray) -> NDArray[np.bool_]:
        return np.asarray(farthest_moved_m(body, pose, poses, limb) >= NEAR_M)

    poses = _drawn(recombiner, pose, limb, DRAWS, rng)
    if aim is not None:
        aimed = aim(_drawn(recombiner, pose, limb, AIMED_OF, rng), AIMED)
        poses = np.concatenate([poses, aimed])
    if thorough:
        poses = poses[far(poses)]
    if not len(poses):
        return poses[:, limb]
    costs_of = frame.limb_costs(pose, limb)
    costs, priors = costs_of(poses[:, limb]), prior_costs(body, poses)
    best = _best(costs, priors, _PARENTS)
    for fraction in LAYERS:
        near = recombiner.with_limb_near(
            np.repeat(poses[best], _CHILDREN, axis=0), limb, fraction, rng
        )
        if thorough:
            near = near[far(near)]
        # Of the last layer only the best draws of both kinds are used, of the others the parents.
        count = 1 if fraction == LAYERS[-1] else _PARENTS
        cutoff = costs[_best(costs, priors, count)].max()
        poses = np.concatenate([poses[best], near])
        more = costs_of(near[:, limb], np.full(len(near), cutoff))
        costs = np.concatenate([costs[best], more])
        priors = np.concatenate([priors[best], prior_costs(body, near)])
        best = _best(costs, priors, count)
    if costs.min() > most_cost + HOPELESS:
        return poses[:0, limb]
    best = best[far(poses[best])]
    return poses[best][:, limb]


def best_refined(frame: FramePopulation, poses: FloatArray) -> tuple[FloatArray, float]:
    """The best of poses (n, p) after a refinement of the whole body on the contours, (p,), and its
    cost (`FramePopulation.costs_with_prior`).
    """
    refined = frame.refined(poses, *_REFINE)
    costs = frame.costs_with_prior(refined)
    best = int(costs.argmin())
    return refined[best], float(costs[best])


def _drawn(
    recombiner: Recombiner, pose: FloatArray, limb: IntArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Poses (count, p) with other limbs: half about the neutral posture, half uniform."""
    half = count // 2
    return np.concatenate(
        [
            recombiner.with_prior_limb(pose, limb, half, rng),
            recombiner.with_limb(pose, limb, count - half, rng),
        ]
    )


def _best(costs: FloatArray, priors: FloatArray, count: int) -> IntArray:
    """Indices of the draws that are among the `count` of least cost, 1 - f_s (n,), or of least cost
    with the prior (n,); in that order.
    """
    first = np.argsort(costs, kind="stable")[:count]
    second = np.argsort(costs + priors, kind="stable")[:count]
    # (Faster than NumPy's set operations.)
    return np.array([*dict.fromkeys((*first, *second))], dtype=np.int64)


def distance_m(body: BodyModel, pose: FloatArray, other: FloatArray) -> float:
    """Largest distance of a marker between two poses (p,)."""
    return float(np.linalg.norm(markers(body, pose) - markers(body, other), axis=1).max())
