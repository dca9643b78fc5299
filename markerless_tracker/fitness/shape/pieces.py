"""Runs fits that are computed in pieces, which a tracker spreads over its frames."""

from collections.abc import Generator

from markerless_tracker.body import BodyModel


def at_once(fitting: Generator[None, None, BodyModel]) -> BodyModel:
    """The body returned by a fit in pieces, after computing all its pieces."""
    while True:
        try:
            next(fitting)
        except StopIteration as end:
            fitted: BodyModel = end.value
            return fitted
