"""A limb that is lost while the rest is tracked: it lies outside the silhouettes."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms
from markerless_tracker.camera import CameraRig, project_camera
from markerless_tracker.geometry import FloatArray
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import Observation
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.breeding import Breeder
from markerless_tracker.tracking.start.population import FramePopulation

LOST_BELOW = 0.55
FOUND_ABOVE = 0.75
"""Shares of a limb's axis inside the silhouettes, mean over the views."""
GAIN = 0.002
"""How much of f_s a limb found elsewhere must bring."""
FEW_VIEWS = 3
"""With so many views or fewer a limb may hide in the others' outlines: each is checked in turn."""
CHECK_EVERY = 2
"""Frames from one limb's turn to the next one's."""
CHECK_GAIN = 0.0015
"""How much of f_s a limb found elsewhere must bring if it did not look lost."""
_DRAWS = 400
_REFINED = 8
_REFINE = (4, (0.12, 0.035))
_ALONG = np.linspace(0.1, 0.9, 5)


class LimbWatch:
    """Tells which limbs lie outside the silhouettes, and looks for those alone.

    Args:
        rig: the cameras.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self.reset()

    def reset(self) -> None:
        """Forget which limbs are lost."""
        self._lost: frozenset[str] = frozenset()
        self._frames = 0

    def mend(
        self,
        searcher: Searcher,
        observations: Mapping[str, Observation],
        stamp_ns: int,
        pose: FloatArray,
    ) -> tuple[FloatArray, tuple[str, ...]]:
        """The pose (p,) with lost limbs found again, and a line for each limb that gets lost."""
        body = searcher.body
        shares = limb_shares(body, pose, observations, self._rig)
        lost = {
            name
            for name, share in shares.items()
            if share < (FOUND_ABOVE if name in self._lost else LOST_BELOW)
        }
        notes = tuple(f"{name}: lost, looked for alone" for name in sorted(lost - self._lost))
        self._lost = frozenset(lost)
        checked = self._in_turn(tuple(shares)) if len(observations) <= FEW_VIEWS else None
        gains = {**({checked: CHECK_GAIN} if checked else {}), **dict.fromkeys(lost, GAIN)}
        if not gains:
            return pose, notes
        frame = FramePopulation(searcher, observations, stamp_ns, pose)
        breeder = Breeder(body, searcher.limits)
        cost = float(frame.costs(pose[None])[0])
        for name, gain in sorted(gains.items()):
            rng = keyed_generator(searcher.config.seed, stamp_ns, f"lost {name}")
            drawn = breeder.with_limb(pose, body.subspaces[name], _DRAWS, rng)
            best = np.argsort(frame.costs(drawn), kind="stable")[:_REFINED]
            tried = frame.refined(drawn[best], *_REFINE)
            costs = frame.costs(tried)
            if costs.min() < cost - gain:
                pose, cost = tried[int(costs.argmin())], float(costs.min())
        return pose, notes

    def _in_turn(self, limbs: tuple[str, ...]) -> str | None:
        """The limb whose turn it is in this frame, if any's."""
        self._frames += 1
        turn, rest = divmod(self._frames, CHECK_EVERY)
        return limbs[turn % len(limbs)] if limbs and rest == 0 else None


def limb_shares(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> dict[str, float]:
    """By limb, how much of its cones' axes lies inside the silhouettes, mean over the views.

    Points outside a view's region count as outside, those outside its frame not at all.
    """
    placed = cone_transforms(body, pose)
    along = (body.cone_length[:, None] * _ALONG)[:, :, None]
    points = (placed[:, None, :, 3] + along * placed[:, None, :, 2]).reshape(-1, 3)
    seen = [_look(points, observation, rig) for observation in observations.values()]
    shares = {}
    for name in body.limbs:
        nodes = np.flatnonzero(np.isin(body.node_parameter, body.subspaces[name]))
        below = np.isin(body.cone_node, list(_below(body, nodes)))
        own = np.repeat(below, _ALONG.size)
        values = [
            float(inside[own].sum()) / float(framed[own].sum())
            for framed, inside in seen
            if framed[own].any()
        ]
        if values:
            shares[name] = float(np.mean(values))
    return shares


def _below(body: BodyModel, nodes: np.ndarray[tuple[int], np.dtype[np.int64]]) -> set[int]:
    below = {int(node) for node in nodes}
    for node, above in enumerate(body.node_parent):
        if int(above) in below:
            below.add(node)
    return below


def _look(
    points: FloatArray, observation: Observation, rig: CameraRig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the points (n, 3) a view has in its frame, and which in its silhouette."""
    pixels = project_camera(points, rig[observation.camera])
    with np.errstate(invalid="ignore"):
        framed = (pixels >= 0.0).all(axis=1) & (pixels <= np.array(observation.size_px) - 1).all(
            axis=1
        )
    inside = np.zeros(len(points), dtype=np.bool_)
    mask = observation.mask
    u, v = (np.round(pixels[framed]) - observation.offset_px).astype(np.int64).T
    there = (u >= 0) & (v >= 0) & (u < mask.shape[1]) & (v < mask.shape[0])
    inside[np.flatnonzero(framed)[there]] = mask[v[there], u[there]]
    return np.asarray(framed), inside
