"""What all swarms' stages share: the whole body explains the whole view."""

from dataclasses import asdict
from typing import Any

import numpy as np

from markerless_tracker.body import BodyModel
from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.records import Stage
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
    **changes: Any,
) -> Stage:
    """A stage of a swarm with every cone in both terms.

    Args:
        body, config: as for `frame_stages`.
        name, algorithm, active, centre, sigma: as in `Stage`.
        budget: particles and iterations.
        changes: other attributes of the stage.
    """
    every_cone = np.ones(len(body.cone_names), dtype=np.bool_)
    attributes: dict[str, Any] = {
        "silhouette_cones": every_cone,
        "edge_cones": every_cone,
        "options": options(algorithm, config),
        **changes,
    }
    return Stage(
        name=name,
        algorithm=algorithm,
        active=active,
        centre=centre,
        sigma=sigma,
        particles=budget[0],
        iterations=budget[1],
        silhouette_weight=1.0,
        edge_weight=config.edge_weight,
        **attributes,
    )


def options(algorithm: str, config: TrackerConfig) -> dict[str, Any]:
    """The settings of an algorithm of `optim`, by its arguments' names."""
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
