"""Fits that are computed in pieces, so that a tracker can spread them over its frames."""

from collections.abc import Generator

from markerless_tracker.body import BodyModel


def at_once(fitting: Generator[None, None, BodyModel]) -> BodyModel:
    """The body that a fit in pieces returns, all its pieces computed now."""
    while True:
        try:
            next(fitting)
        except StopIteration as end:
            fitted: BodyModel = end.value
            return fitted
