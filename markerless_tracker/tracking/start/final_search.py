"""The last search of an automatic start: with the body that was fitted to the person."""

from collections.abc import Mapping

import numpy as np

from markerless_tracker.body import markers
from markerless_tracker.body.anatomy import heading, heading_difference
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Observation
from markerless_tracker.tracking.candidates.own_evidence import OwnEvidence
from markerless_tracker.tracking.candidates.population import FramePopulation
from markerless_tracker.tracking.evidence.hull import find_hulls
from markerless_tracker.tracking.evidence.undecided import decide
from markerless_tracker.tracking.search import Searcher
from markerless_tracker.tracking.start.generations import improved

TURNED = "start: the person has the opposite heading, turned round"
"""Note of a start that takes the opposite heading."""

_GENERATIONS = range(20, 25)
"""Numbers of the generations, which key the draws; the searches before have smaller ones."""
_REFINE = (4, (0.12, 0.035))
"""Iterations of the refinement of both poses; truncation (m) in the first and the last one."""


def searched_again(
    searcher: Searcher,
    pose: FloatArray,
    imaged: Mapping[str, Observation],
    stamp_ns: int,
    charges_postures: bool,
) -> tuple[FloatArray, tuple[str, ...]]:
    """The pose (p,) of a frame, and notes, after an independent search with the fitted body.

    The searches before had a body of generic widths. In loose clothes that favours wrong poses: an
    arm inside a wide trunk, or a trunk that is turned. The pose found is taken if it costs less,
    each of the two refined and in its own evidence.

    Args:
        searcher: with the fitted body.
        pose: (p,) the one found so far, with this body.
        imaged: the evidence, with the undecided pixels that imaging left.
        stamp_ns: its time.
        charges_postures: as in `FramePopulation`.
    """
    observations = decide(imaged, searcher.cameras, searcher.body, pose)
    hull = next(find_hulls(searcher.cameras, observations), None)
    if hull is None:
        return pose, ()
    frame = FramePopulation(
        searcher, observations, stamp_ns, pose, charges_postures=charges_postures
    )
    population = improved(frame, frame.initialised(frame.guesses(hull, pose[None])), _GENERATIONS)
    own = OwnEvidence(searcher, imaged, stamp_ns, frame)
    known, found = (own.refined(each, *_REFINE) for each in (pose, population.poses[0]))
    if own.gain(known, found) <= 0.0:
        return pose, ()
    was_rad, is_rad = (heading(markers(searcher.body, each)) for each in (pose, found))
    turned = heading_difference(was_rad, is_rad) > 0.5 * np.pi
    return found, (TURNED,) if turned else ()
