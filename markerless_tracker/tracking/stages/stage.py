"""The stage of a swarm: compares the whole body with the whole views."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Comparison, SearchPlan, Stage
from markerless_tracker.tracking.config import TrackerConfig


def swarm_stage(
    body: BodyModel,
    config: TrackerConfig,
    name: str,
    algorithm: str,
    active: IntArray,
    centre: FloatArray,
    sigma: FloatArray,
    budget: tuple[int, int],
    *,
    edge_cones: NDArray[np.bool_] | None = None,
) -> Stage:
    """The stage of a swarm.

    Args:
        body, config: as for `frame_stages`.
        name, algorithm, active, centre, sigma: as in `Stage` and its parts.
        budget: particles and iterations.
        edge_cones: (c,) cones whose edges are compared; all if None.
    """
    comparison = Comparison.whole(centre, len(body.cone_names), edge_weight=config.edge_weight)
    comparison = replace(
        comparison,
        active=active,
        edge_cones=comparison.edge_cones if edge_cones is None else edge_cones,
    )
    plan = SearchPlan(algorithm, sigma, *budget, options=options(algorithm, config))
    return Stage(name, comparison, plan)


def options(algorithm: str, config: TrackerConfig) -> dict[str, Any]:
    """The settings of an algorithm of `optim`, by the names of its arguments."""
    swarm = asdict(config.pso)
    cooperative = config.hmcpso
    return {
        "sppso": {"update": config.sppso.update},
        "pso": swarm,
        "mcpso": {
            **swarm,
            "sub_swarms": cooperative.sub_swarms,
            "migration": cooperative.migration,
            "master_term": cooperative.master_term,
        },
        "apf": {
            "survival": config.apf.survival,
            "shrink": config.apf.layer_shrink,
            "estimate": config.apf.estimate,
        },
        "pf": asdict(config.pf),
    }[algorithm]
