"""How fast the cores are at this time: the reference on one core, and on all cores at once.

Two cores of a shared machine may be halves of one, or have other work to do. Figures of a program
that uses all cores, measured at different times, can be compared only with these beside them.
"""

import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Barrier

import cv2
import numpy as np

from markerless_tracker.benchmarks.speed.parts import poses_around
from markerless_tracker.benchmarks.speed.reference import ReferenceFitness
from markerless_tracker.benchmarks.speed.scene import SIZE_PX
from markerless_tracker.geometry import FloatArray
from markerless_tracker.libraries import usable_cores
from markerless_tracker.records import Observation
from markerless_tracker.synthesis import SyntheticScene

_POSES = 16
_VIEWS = 4
_SECONDS = 0.5
_WAIT_S = 120.0


@dataclass(frozen=True)
class CoreSpeed:
    """Speed of the reference evaluation (`ReferenceFitness`), four made-up views of 644x488 px.

    Attributes:
        reference_us: mean time of a view-evaluation while one core works, µs.
        at_once: what all cores do at once, as a multiple of what one does alone: the number of
            cores if they do not slow each other down.
    """

    reference_us: float
    at_once: float

    @classmethod
    def of_rates(cls, alone: float, at_once: Sequence[float]) -> "CoreSpeed":
        """From view-evaluations per second: of one core alone, and of each while all work."""
        return cls(1e6 / alone, sum(at_once) / alone)


@contextmanager
def core_meter() -> Iterator[Callable[[], CoreSpeed]]:
    """A function that measures the speed of the cores, within two seconds.

    There is one process for each core; they are idle between measurements.
    """
    cores = usable_cores()
    spawning = multiprocessing.get_context("spawn")
    barrier = spawning.Barrier(cores)
    with ProcessPoolExecutor(cores, spawning, _begin, (barrier,)) as pool:

        def measure() -> CoreSpeed:
            at_once = list(pool.map(_rate_of_all, range(cores)))
            return CoreSpeed.of_rates(pool.submit(_rate).result(), at_once)

        yield measure


@dataclass(frozen=True)
class _Work:
    """What a process evaluates, and where it waits for the others."""

    fitness: ReferenceFitness
    poses: FloatArray
    barrier: Barrier


_work: _Work | None = None
"""Of this process, from its beginning on."""


def _begin(barrier: Barrier) -> None:
    """Prepare the evaluation of a made-up person's exact silhouettes."""
    global _work
    cv2.setNumThreads(1)
    scene = SyntheticScene(size_px=SIZE_PX, samples=1)
    _, masks, pose = scene.frame(0)
    silhouettes = {name: mask.astype(np.uint8) for name, mask in masks.items()}
    seen = {name: Observation.from_mask(name, 0, s, s) for name, s in silhouettes.items()}
    fitness = ReferenceFitness(scene.body, scene.rig.cameras, seen, pose)
    _work = _Work(fitness, poses_around(scene.body, pose, _POSES), barrier)


def _rate_of_all(_: int) -> float:
    """As `_rate`, when all processes are ready: each process takes one of as many tasks."""
    assert _work is not None
    _work.barrier.wait(_WAIT_S)
    return _rate()


def _rate() -> float:
    """View-evaluations per second of this process."""
    assert _work is not None
    done, began_s = 0, time.perf_counter()
    while (passed_s := time.perf_counter() - began_s) < _SECONDS:
        _work.fitness(_work.poses)
        done += len(_work.poses) * _VIEWS
    return done / passed_s
