"""Lost limbs: detecting them, and searching for them while the rest of the body stays.

A limb outside the silhouettes is detected. A wrong limb inside the silhouettes goes undetected, so
all limbs are searched elsewhere in rotation, and both legs or both arms are exchanged.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel, cone_transforms, markers
from markerless_tracker.body.model import IntArray
from markerless_tracker.body.parts import cones_of
from markerless_tracker.camera import CameraRig
from markerless_tracker.camera.lens import projected
from markerless_tracker.compiled import kernel
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.fitness.raster.mask_words import has
from markerless_tracker.geometry import FloatArray
from markerless_tracker.observation import locked
from markerless_tracker.optim import keyed_generator
from markerless_tracker.records import LimbState, Observation, TrackState
from markerless_tracker.tracking.evidence.seen import Seen
from markerless_tracker.tracking.limbs.aimed import most_aimed
from markerless_tracker.tracking.limbs.exchange import CLOSE, PairExchange
from markerless_tracker.tracking.limbs.facing import FacingWatch
from markerless_tracker.tracking.limbs.search import LimbSearch
from markerless_tracker.tracking.limbs.unexplained import look_unexplained
from markerless_tracker.tracking.limbs.walking import CLOSE as WALKING_CLOSE
from markerless_tracker.tracking.limbs.walking import LEAST_GAIN as WALKING_GAIN
from markerless_tracker.tracking.limbs.walking import WalkingWatch
from markerless_tracker.tracking.loss import LimbTrack
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.own_evidence import OwnEvidence
from markerless_tracker.tracking.start.population import FramePopulation
from markerless_tracker.tracking.start.recombination import Recombiner

ROTATION_NS = 100_000_000
"""One limb that is not lost is searched elsewhere this often: every sixth frame at 60 frames/s."""
WAIT_NS = 16_000_000
"""Time before a limb near unexplained silhouette is searched again, after a search without gain."""
RECOVERED_M = 0.10
"""A limb that is found so far from its last place was wrong there."""
_DOUBLINGS = 4
"""That time doubles with each search without gain, so often."""
_GROWN = 2.0
"""An earlier search does not count where the unexplained area has grown by this factor."""
_NONE = locked(np.empty((0, 0), dtype=np.uint64), np.uint64)
_ALONG = np.linspace(0.1, 0.9, 5)


@dataclass(frozen=True, eq=False)
class Recovered:
    """What was found elsewhere in a frame.

    Attributes:
        pose: (p,) the estimate.
        names: of the limbs that were taken from elsewhere; `legs` and `arms` are exchanged.
        turned: whether the person faces another way; nothing of the body is where it was.
        moved_m: how far the limbs' joints were from where they were found, at most.
    """

    pose: FloatArray
    names: tuple[str, ...] = ()
    turned: bool = False
    moved_m: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, one line each."""
        if self.turned:
            return ("the person faces another way: turned round",)
        return tuple(f"{name}: found elsewhere" for name in self.names)

    def jumped(self, body: BodyModel) -> IntArray:
        """Indices of the parameters that do not continue those of the last frame."""
        if self.turned:
            return np.arange(body.size)
        return np.array([i for name in self.names for i in body.subspaces[name]], dtype=np.int64)

    def placed(self, body: BodyModel, limits: FloatArray, corrected: FloatArray) -> FloatArray:
        """The pose (p,): limbs that were wrong jump, the rest of the body does not.

        Args:
            body: the body.
            limits: (2, p) of what does not jump.
            corrected: (2, p) the same of limbs that were nearly in their places (`RECOVERED_M`).
        """
        pose, jumped = np.clip(self.pose, *limits), self.jumped(body)
        pose[jumped] = self.pose[jumped]
        if not self.turned and self.moved_m <= RECOVERED_M:
            pose[jumped] = np.clip(pose, *corrected)[jumped]
        return np.asarray(pose)


@dataclass(frozen=True)
class _Wait:
    """Searches of a limb that did not improve it.

    Attributes:
        failures: number of such searches in a row.
        searched_ns: time of the last one.
        area_m2: of the unexplained silhouette at that time.
    """

    failures: int
    searched_ns: int
    area_m2: float

    def over(self, stamp_ns: int, area_m2: float) -> bool:
        """Whether the limb may be searched again at a time, with that unexplained area."""
        since_ns = stamp_ns - self.searched_ns
        grown = area_m2 > _GROWN * self.area_m2
        return grown or not 0 <= since_ns < WAIT_NS * 2**self.failures


class LimbWatch:
    """Detects lost limbs, and searches limbs alone: the lost ones, and all in rotation.

    Args:
        rig: the cameras.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self.reset()

    def reset(self) -> None:
        """Forget the limbs so far."""
        self._tracks: dict[str, LimbTrack] = {}
        self._next = 0
        self._turn = 0
        self._unexplained = 0
        self._rotated_ns: int | None = None
        self._waits: dict[str, _Wait] = {}
        self._exchange = PairExchange()
        self._facing = FacingWatch()
        self._walking = WalkingWatch()

    @property
    def lost(self) -> tuple[str, ...]:
        """Limbs that were lost when last assessed."""
        return tuple(n for n, track in self._tracks.items() if track.state is TrackState.LOST)

    def assess(
        self,
        body: BodyModel,
        pose: FloatArray,
        observations: Mapping[str, Observation],
        particle_sd_ratio: FloatArray,
    ) -> dict[str, LimbState]:
        """By limb, its state at a pose (p,).

        Args:
            body: the body.
            pose: the estimate.
            observations: the silhouettes.
            particle_sd_ratio: (p,) as in `FrameSearch`.
        """
        fractions = inside_fractions(body, pose, observations, self._rig)
        states = {}
        for name in body.limbs:
            inside_fraction = fractions.get(name, float("nan"))
            wide = float(np.sqrt(np.mean(particle_sd_ratio[body.subspaces[name]] ** 2)))
            track = self._tracks.setdefault(name, LimbTrack())
            state = track.note(inside_fraction, wide) if name in fractions else track.state
            states[name] = LimbState(state, inside_fraction, wide)
        return states

    def recover(
        self,
        searcher: Searcher,
        contours: ContourFrame,
        seen: Seen,
        pose: FloatArray,
        *,
        one: bool = False,
    ) -> Recovered:
        """Search the limbs that `assess` found lost, and the next one in rotation.

        A limb is taken from elsewhere if f_s rises as clearly as a swarm's result must
        (`min_improvement`), each pose in the evidence that it decides itself.

        Args:
            searcher: of the frame.
            contours: the frame's contours.
            seen: the frame's evidence.
            pose: (p,) the estimate.
            one: whether there is time for one thing alone: what compares the whole body's poses, or
                one of the limbs, in turn.
        """
        body, stamp_ns, observations = searcher.body, seen.stamp_ns, seen.used
        if not body.limbs:
            return Recovered(pose)
        unexplained = look_unexplained(body, pose, observations, self._rig)
        if not unexplained.limbs:
            self._waits.clear()
        due = self._due(body, stamp_ns, unexplained.areas_m2)
        pair, facing, walking = None, False, []
        self._turn += 1
        if not one or self._turn % 2:
            pair = self._exchange.due(body, pose, searcher.limits, stamp_ns)
            facing = self._facing.due(stamp_ns)
            walking = self._walking.due(body, pose, searcher.limits, stamp_ns)
        whole = facing or pair is not None or bool(walking)
        if one and due:
            due = [] if whole else [due[self._turn // 2 % len(due)]]
        if not due and not whole:
            return Recovered(pose)
        frame = FramePopulation(searcher, observations, stamp_ns, pose, contours=contours)
        reach_m = searcher.tracked_reach_m
        own = OwnEvidence(searcher, seen.imaged, stamp_ns, frame, reach_m=reach_m)
        recombiner = Recombiner(body, searcher.limits)
        search = LimbSearch(recombiner, frame, own, pose, searcher.config.min_improvement)
        if facing:
            turned = self._facing.compare(search, body, searcher.limits)
            if turned is not None:
                return Recovered(turned, turned=True)
        for other in walking:
            if search.takes(other, WALKING_GAIN, WALKING_CLOSE):
                # Its sums belong to the heading so far.
                self._facing.reset()
                return Recovered(search.pose, turned=True)
        found = []
        if pair is not None and search.takes(pair.pose, pair.least_gain, CLOSE):
            found.append(pair.name)
        for name in due:
            rng = keyed_generator(searcher.config.seed, stamp_ns, f"{name} elsewhere")
            limb = body.subspaces[name]
            aim = None
            if unexplained.regions:
                aim = partial(
                    most_aimed, body, limb=limb, regions=unexplained.regions, rig=self._rig
                )
            if search.elsewhere(limb, rng, aim):
                found.append(name)
                self._waits.pop(name, None)
            else:
                self._search_failed(name, stamp_ns, unexplained.areas_m2.get(name, 0.0))
        moved_m = np.linalg.norm(markers(body, search.pose) - markers(body, pose), axis=1).max()
        return Recovered(search.pose, tuple(found), moved_m=float(moved_m))

    def _search_failed(self, name: str, stamp_ns: int, area_m2: float) -> None:
        failures = 1
        before = self._waits.get(name)
        if before is not None and area_m2 <= _GROWN * before.area_m2:
            failures = min(before.failures + 1, 1 + _DOUBLINGS)
        self._waits[name] = _Wait(failures, stamp_ns, area_m2)

    def _due(self, body: BodyModel, stamp_ns: int, areas_m2: Mapping[str, float]) -> list[str]:
        """Limbs to search: lost, near unexplained silhouette, and at times the next in rotation."""
        lost = self.lost
        due = [*lost, *(n for n in self._suspects(stamp_ns, areas_m2) if n not in lost)]
        if self._rotated_ns is not None and 0 <= stamp_ns - self._rotated_ns < ROTATION_NS:
            return due
        self._rotated_ns = stamp_ns
        name = body.limbs[self._next % len(body.limbs)]
        self._next += 1
        return due if name in due else [*due, name]

    def _suspects(self, stamp_ns: int, areas_m2: Mapping[str, float]) -> list[str]:
        """The likeliest limb, and the others in rotation while silhouette stays unexplained.

        Limbs whose search failed shortly before are left out.
        """
        if not areas_m2:
            self._unexplained = 0
            return []
        self._unexplained += 1
        first, *others = areas_m2
        names = [first, *others[(self._unexplained - 1) % len(others) :][:1]] if others else [first]
        waits = self._waits
        return [n for n in names if n not in waits or waits[n].over(stamp_ns, areas_m2[n])]


def inside_fractions(
    body: BodyModel,
    pose: FloatArray,
    observations: Mapping[str, Observation],
    rig: CameraRig,
) -> dict[str, float]:
    """By limb, how much of its cones' axes lies inside the silhouettes, mean over the views.

    Points outside a view's region count as outside; those outside its frame, and those on
    undecided pixels, do not count.
    """
    placed = cone_transforms(body, pose)
    along = (body.cone_length[:, None] * _ALONG)[:, :, None]
    points = (placed[:, None, :, 3] + along * placed[:, None, :, 2]).reshape(-1, 3)
    seen = [_look(points, observation, rig) for observation in observations.values()]
    fractions = {}
    for name in body.limbs:
        own = np.repeat(cones_of(body, name), _ALONG.size)
        values = [
            float(inside[own].sum()) / float(framed[own].sum())
            for framed, inside in seen
            if framed[own].any()
        ]
        if values:
            fractions[name] = float(np.mean(values))
    return fractions


def _look(
    points: FloatArray, observation: Observation, rig: CameraRig
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the points (n, 3) a view has in its frame, and which in its silhouette."""
    camera = rig[observation.camera]
    undecided = observation.undecided_words
    framed, inside = np.zeros((2, len(points)), dtype=np.bool_)
    _find(
        points, camera.T_cam_world, camera.matrix, camera.distortion, observation.size_px,
        observation.offset_px, (observation.width, observation.height), observation.mask_words,
        _NONE if undecided is None else undecided,
        framed, inside,
    )  # fmt: skip
    return framed, inside


@kernel
def _find(  # type: ignore[no-untyped-def]
    points, to_camera, matrix, distortion, size, offset, region, mask, undecided, framed, inside
):
    for i in range(points.shape[0]):
        u, v = projected(points[i, 0], points[i, 1], points[i, 2], to_camera, matrix, distortion)
        # Not for NaN either.
        if not (u >= 0.0 and v >= 0.0 and u <= size[0] - 1.0 and v <= size[1] - 1.0):
            continue
        framed[i] = True
        column, row = np.int64(np.rint(u)) - offset[0], np.int64(np.rint(v)) - offset[1]
        if column < 0 or row < 0 or column >= region[0] or row >= region[1]:
            continue
        inside[i] = has(mask, column, row)
        if undecided.size > 0 and has(undecided, column, row):
            framed[i] = False
