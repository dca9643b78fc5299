"""What the segmenting process compiles besides its own kernels, while its parent compiles the rest.

Compilation is most of a first start, and one process compiles one kernel at a time. What one
process has compiled is stored on disk, where the other finds it.
"""

from collections.abc import Mapping

from markerless_tracker.body import load_body
from markerless_tracker.body.load import load_description
from markerless_tracker.body.sizes import Sizes
from markerless_tracker.camera import CameraRig
from markerless_tracker.fitness.contour import outline_rows
from markerless_tracker.optim import Prior
from markerless_tracker.records import Observation
from markerless_tracker.tracking.confidence import disagreement_m, jacobians
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.person.body_fitting import BodyFitting, Unmeasured
from markerless_tracker.tracking.refinement import refined_on_contours
from markerless_tracker.tracking.search import make_searcher

_TRUNCATION_M = (0.1, 0.1)


def compile_contours(
    rig: CameraRig, config: TrackerConfig, observations: Mapping[str, Observation]
) -> None:
    """Compile what takes contours: refinement, confidence and the fit of the body's lengths.

    Nothing is compiled if the configuration has no refinement.

    Args:
        rig: the cameras.
        config: every setting.
        observations: made up, by camera name.
    """
    if config.refinement == "none":
        return
    body = load_body(config.body)
    searcher = make_searcher(body, rig=rig, config=config, threads=1)
    contours = searcher.frame(observations, 0, body.neutral).contours
    refined_on_contours(
        contours,
        body.neutral,
        config,
        priors=(Prior(body.neutral, 1.0 / body.prior_sd**2),),
        limits=searcher.limits,
        iterations=1,
        truncation_m=_TRUNCATION_M,
    )
    # These are what `confidence_of` calls; it would skip them, as nothing is seen of the body.
    jacobians(body, body.neutral)
    disagreement_m(contours, outline_rows(contours))
    if config.fit_shape and config.fit_lengths:
        person = Unmeasured(Sizes(load_description(config.body)), None)
        BodyFitting(person, searcher.limits).warm_up(body, contours, body.neutral)
