"""All settings of a tracker, in one frozen record; and the presets."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from markerless_tracker.body import RULES
from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness import COSTS
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.settings import group, setting
from markerless_tracker.tracking.groups import (
    ApfSettings,
    EdgeSettings,
    HmcpsoSettings,
    PfSettings,
    PsoSettings,
    RefineSettings,
    RegionSettings,
    SigmaSettings,
    SppsoSettings,
)

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "tuned": {},
    "paper": {
        "body": "balan31",
        "correct_cameras": False,
        "edges.form": "published",
        "edges.rule": "visible",
        "edge_weight": 1.0,
        "fit_lengths": False,
        "fit_shape": False,
        "prediction": 0.0,
        "refinement": "none",
        "search_again": False,
        "shadow.undecided": False,
        "sigma.scale": 1.0,
    },
}
"""The settings of each preset; all others keep their defaults."""

_SAINI: Mapping[str, Any] = {"body": "humaneva34", "cost": "bidirectional", "sigma.angle": 0.1}
PAPERS: Mapping[str, Mapping[str, Any]] = {
    "sppso": {},
    "hmcpso": _SAINI,
    "hpso": _SAINI,
    "mcpso": _SAINI,
    "pso": _SAINI,
    "glpso": _SAINI,
    "apf": {**_SAINI, "sigma.angle": 0.0},
    "pf": {**_SAINI, "sigma.angle": 0.0},
}
"""Additional settings of the preset 'paper' for each optimiser. All but SPPSO are set as in the
comparison of Saini et al. (2015), whose swarms start with a variance of 0.01 rad² [R]. The paper
states no noise for the filters: they use the body's own sigma, as in the filters' own papers."""

OPTIMIZERS = tuple(PAPERS)
"""The search algorithms, by name."""


_LIVE = (
    "optimizer", "evaluations", "min_improvement", "prediction", "smoothing", "search_again",
    "partition",
)  # fmt: skip
_LIVE_GROUPS = ("refine", "sigma", "sppso", "pso", "hmcpso", "apf", "pf")


def live_settings() -> frozenset[str]:
    """Names of the settings that may change between two steps: those of the search.

    The others determine objects that are made once: backgrounds, body, limits.
    """
    names = (entry.name for entry in TrackerConfig.settings())
    return frozenset(n for n in names if n in _LIVE or n.partition(".")[0] in _LIVE_GROUPS)


def own_evaluations(optimizer: str) -> int:
    """Evaluations per frame that an optimiser was published with."""
    return 1000 if optimizer == "sppso" else 3600


@dataclass(frozen=True, kw_only=True)
class TrackerConfig(ImagingSettings):
    """All settings that a result depends on, including those of the imaging.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """

    preset: str = setting(
        "tuned",
        "tuned: the settings with the lowest errors; paper: every setting as published",
        choices=tuple(PRESETS),
    )
    optimizer: str = setting("sppso", "search algorithm", choices=OPTIMIZERS)
    body: str = setting("person32", "body: a shipped one's name, or a YAML file")
    evaluations: int = setting(
        1000,
        "budget per frame, in evaluations of the fitness: exactly that many without refinement; "
        "with refinement, the time that swarm and refinement may take together; default: the "
        "published budget of the optimiser, sppso 1000, others 3600",
        least=1,
        most=10**7,
    )
    refinement: str = setting(
        "contour",
        "contour: align with the contours before and after the swarm; none: swarm alone",
        choices=("contour", "none"),
    )
    min_improvement: float = setting(
        0.001,
        "with refinement: least rise of f for which a swarm's result is taken",
        least=0.0,
        most=2.0,
    )
    prediction: float = setting(
        0.6,
        "fraction of the last change of pose that is predicted again; 0 = zero motion",
        least=0.0,
        most=1.0,
    )
    smoothing: str = setting(
        "none",
        "one_euro: results pass a causal filter that reduces jitter at rest; none",
        choices=("none", "one_euro"),
    )
    search_again: bool = setting(
        True,
        "search the whole views for a body that has been lost for a tenth of a second, and the "
        "whole range of limbs that may be lost",
    )
    fit_shape: bool = setting(
        True,
        "fit the body's sections to the first frame's silhouettes, unless the subject has them",
    )
    fit_lengths: bool = setting(
        True,
        "with fit_shape: fit lengths that were not measured, and the sections with them, to the "
        "first tracked frames, and again while new postures come; if they were measured, only the "
        "hands' length",
    )
    correct_cameras: bool = setting(
        True,
        "shift the image of a camera whose silhouettes lie at least 30 mm beside the body as three "
        "or more other cameras see it",
    )
    seed: int = setting(0, "seed of all random draws", least=0, most=2**63 - 1)
    threads: int = setting(
        0, "threads of the fitness, 0 = as many as the machine has cores", least=0, most=256
    )
    limits: str = setting(
        "anatomical",
        "joint limits: anatomical; bt_walking: the published ones, learned from one walk",
        choices=("anatomical", "bt_walking"),
    )
    collision: str = setting(
        "elliptic",
        "inter-penetration rule: elliptic sections with a margin; published: round, no margin; "
        "none",
        choices=RULES,
    )
    partition: str = setting(
        "soft",
        "of sppso's and hmcpso's steps; soft: parameters of earlier steps vary again with a small "
        "sigma; hard: they are fixed",
        choices=("soft", "hard"),
    )
    cost: str = setting(
        "overlap",
        "overlap: sum of the weights - f for f = f_s + f_e; H-MCPSO's costs: one_sided: body "
        "pixels outside the silhouette; bidirectional: these, and silhouette pixels outside the "
        "body",
        choices=COSTS,
    )
    edge_weight: float = setting(0.0, "weight of f_e beside f_s", least=0.0, most=100.0)
    refine: RefineSettings = group(RefineSettings)
    sigma: SigmaSettings = group(SigmaSettings)
    edges: EdgeSettings = group(EdgeSettings)
    region: RegionSettings = group(RegionSettings)
    sppso: SppsoSettings = group(SppsoSettings)
    pso: PsoSettings = group(PsoSettings)
    hmcpso: HmcpsoSettings = group(HmcpsoSettings)
    apf: ApfSettings = group(ApfSettings)
    pf: PfSettings = group(PfSettings)

    @classmethod
    def from_mapping(cls, values: Mapping[Any, Any], preset: str | None = None) -> Self:
        """A configuration made of a preset (named in the values or given) and the given values.

        Groups may be nested (``{"apf": {"layers": 5}}``) or dotted (``{"apf.layers": 5}``).

        Raises:
            ConfigError: an unknown key, naming the nearest known one, or an impossible value.
        """
        values = cls.dotted(values)
        name = values.get("preset", preset or "tuned")
        if not isinstance(name, str) or name not in PRESETS:
            raise ConfigError(f"preset is {name!r}, expected one of {', '.join(PRESETS)}")
        optimizer = values.get("optimizer", "sppso")
        own: dict[str, Any] = {}
        # Any other value is refused below, with the other values.
        if isinstance(optimizer, str) and optimizer in PAPERS:
            own = {"evaluations": own_evaluations(optimizer)}
            if name == "paper":
                own.update(PAPERS[optimizer])
        return super().from_mapping({**PRESETS[name], **own, **values, "preset": name})
