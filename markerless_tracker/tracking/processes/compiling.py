"""What the segmenting process compiles of the refinement, while its parent compiles the rest.

Compilation is most of a first start, and one process compiles one kernel at a time. What one
process has compiled is stored on disk, where the other finds it.
"""

from collections.abc import Mapping

from markerless_tracker.body import load_body
from markerless_tracker.camera import CameraRig
from markerless_tracker.optim import Prior
from markerless_tracker.records import Observation
from markerless_tracker.tracking.config import TrackerConfig
from markerless_tracker.tracking.refinement import refined_on_contours
from markerless_tracker.tracking.search import make_searcher

_TRUNCATION_M = (0.1, 0.1)


def compile_refinement(
    rig: CameraRig, config: TrackerConfig, observations: Mapping[str, Observation]
) -> None:
    """Compile the contour refinement of a configuration, unless it has none.

    Args:
        rig: the cameras.
        config: every setting.
        observations: made up, by camera name.
    """
    if config.refinement == "none":
        return
    body = load_body(config.body)
    searcher = make_searcher(body, rig=rig, config=config, threads=1)
    refined_on_contours(
        searcher.frame(observations, 0, body.neutral).contours,
        body.neutral,
        config,
        priors=(Prior(body.neutral, 1.0 / body.prior_sd**2),),
        limits=searcher.limits,
        iterations=1,
        truncation_m=_TRUNCATION_M,
    )
