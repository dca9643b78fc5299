"""Generations of a start's population, until its best pose fits well and hardly improves."""

from collections.abc import Iterable

from markerless_tracker.tracking.candidates.population import FramePopulation, Population

_FITS = 0.85
"""If 1 - cost is at least this, a generation that gains less than `_GAIN` is the last one."""
_GAIN = 0.002


def improved(
    frame: FramePopulation, population: Population, generations: Iterable[int]
) -> Population:
    """A population after generations; fewer if the best pose fits well and hardly improves.

    Args:
        frame: the frame's evidence.
        population: the parents.
        generations: their numbers, which key the draws.
    """
    for generation in generations:
        before = population.costs[0]
        population = frame.recombined(population, generation)
        cost = population.costs[0]
        if before - cost < _GAIN and 1.0 - cost >= _FITS:
            break
    return population
