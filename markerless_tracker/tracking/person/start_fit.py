"""The body fitted to the frames of an automatic start, at once."""

from collections.abc import Sequence

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.fitness.contour import ContourFrame
from markerless_tracker.fitness.shape import BodyFit, fit_shape
from markerless_tracker.geometry import FloatArray
from markerless_tracker.tracking.person.body_fitting import TRUNCATION_M, Unmeasured
from markerless_tracker.tracking.refinement import floor_precision
from markerless_tracker.tracking.search import Searcher

STEPS = 5
"""Gauss-Newton steps, if the lengths are fitted, too."""


def fitted_to_start(
    searcher: Searcher,
    frames: Sequence[tuple[ContourFrame, FloatArray]],
    person: Unmeasured | None,
) -> tuple[BodyModel, FloatArray]:
    """The body fitted to frames of a start, and the pose (p,) of the last frame with it.

    Sections are fitted with the poses held. Lengths that were not measured are fitted, too, and the
    poses with them: a limb that is shorter than the mean person's is explained by its pose, and its
    joints stay in the wrong place, until it has its own length.

    Args:
        searcher: with the body so far, whose sections are generic.
        frames: contour evidence of some frames, and the pose (p,) in each; at least one.
        person: what is known of a person whose lengths are to be fitted; None if they are known.
    """
    body = searcher.body
    if person is None:
        hands = searcher.config.fit_lengths
        return fit_shape(body, list(frames), hands=hands), frames[-1][1]
    fit = BodyFit(
        person.sizes, body, person.sizes.prior(person.stature_m), searcher.limits,
        floor_precision=floor_precision(searcher.config),
    )  # fmt: skip
    for contours, pose in frames:
        fit.add(contours, pose)
    for truncation_m in np.geomspace(*TRUNCATION_M, STEPS):
        for _ in fit.pieces(float(truncation_m)):
            pass
    return fit.body, fit.poses[-1]
