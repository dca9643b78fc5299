"""The last part of an automatic start: the fit of the body."""

from collections.abc import Sequence

import numpy as np

from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.person.body_fitting import Unmeasured
from markerless_tracker.tracking.person.start_fit import fitted_to_start
from markerless_tracker.tracking.search import Searcher, SearcherFor
from markerless_tracker.tracking.start.two_headings import HeadingFit

_SHAPE_FRAMES = 5
"""Most frames that the sections are fitted to."""
_SHAPE_SLACK = 0.01
"""Frames that the sections are fitted to cost at most this much more than the best."""


def with_fitted_body(
    searcher: Searcher,
    searcher_for: SearcherFor,
    person: Unmeasured | None,
    *,
    fits: Sequence[HeadingFit],
    contours: ContourFrame,
    pose: FloatArray,
) -> tuple[Searcher, FloatArray]:
    """A searcher with the body fitted to the frames that it explains best, and the last pose (p,).

    Args:
        searcher: with the body found so far.
        searcher_for: makes a searcher of a body.
        person: as in `fitted_to_start`.
        fits: of the heading that was kept, by frame.
        contours: of the last frame.
        pose: (p,) the best one in it with that heading.
    """
    good = min((fit.cost for fit in fits), default=0.0) + _SHAPE_SLACK
    used = [(fit.contours, fit.pose) for fit in fits if fit.cost <= good][-_SHAPE_FRAMES:]
    used = used or [(contours, pose)]
    body, last = fitted_to_start(searcher, used, person)
    fitted = searcher_for(body)
    return fitted, np.clip(pose + last - used[-1][1], *fitted.limits)
