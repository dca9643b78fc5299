"""All settings of a tracker, in one flat frozen record; and the presets."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Self

from markerless_tracker.body import RULES
from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness import COSTS, EDGE_RULES, EDGE_TERMS
from markerless_tracker.imaging import ImagingSettings
from markerless_tracker.optim import ESTIMATES, MASTER_TERMS, UPDATES
from markerless_tracker.settings import setting

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "tuned": {},
    "paper": {
        "body": "balan31",
        "edge_form": "published",
        "edge_rule": "visible",
        "edge_weight": 1.0,
        "fit_lengths": False,
        "fit_shape": False,
        "prediction": 0.0,
        "refinement": "none",
        "search_again": False,
        "shadow_undecided": False,
        "sigma_scale": 1.0,
    },
}
"""What each preset sets; everything else keeps its default."""

_SAINI: Mapping[str, Any] = {"body": "humaneva34", "cost": "bidirectional", "angle_sigma": 0.1}
PAPERS: Mapping[str, Mapping[str, Any]] = {
    "sppso": {},
    "hmcpso": _SAINI,
    "hpso": _SAINI,
    "mcpso": _SAINI,
    "pso": _SAINI,
    "glpso": _SAINI,
    "apf": {**_SAINI, "angle_sigma": 0.0},
    "pf": {**_SAINI, "angle_sigma": 0.0},
}
"""What the preset 'paper' sets besides for each optimiser: what is not SPPSO is set as in the
comparison of Saini et al. (2015), whose swarms start with a variance of 0.01 rad² [R]. Of the
filters' noise the paper says nothing: the body's own spreads, as in the filters' own papers."""

OPTIMIZERS = tuple(PAPERS)
"""The search algorithms, by name."""


def own_evaluations(optimizer: str) -> int:
    """Evaluations per frame that an optimiser was published with."""
    return 1000 if optimizer == "sppso" else 3600


@dataclass(frozen=True)
class Setting:
    """One setting as users meet it: key of `--config`, and parameter of the node."""

    name: str
    type: type
    default: Any
    doc: str
    choices: tuple[str, ...] | None


@dataclass(frozen=True, kw_only=True)
class TrackerConfig(ImagingSettings):
    """Every setting that a result depends on, those of the imaging included.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """

    preset: str = setting(
        "tuned",
        "tuned: what measures best; paper: every setting as published",
        choices=tuple(PRESETS),
    )
    optimizer: str = setting("sppso", "search algorithm", choices=OPTIMIZERS)
    body: str = setting("person31", "body: a shipped one's name, or a YAML file")
    evaluations: int = setting(
        1000,
        "budget per frame, in evaluations of the fitness: exactly that many without refinement; "
        "with it the time that swarm and refinement may take together; unless given, the "
        "optimiser's own: sppso 1000, others 3600",
        least=1,
        most=10**7,
    )
    refinement: str = setting(
        "contour",
        "contour: align with the silhouettes' edges before and after the swarm; none: swarm alone",
        choices=("contour", "none"),
    )
    refine_iterations: int = setting(
        4, "iterations of each of the two contour refinements", least=1, most=1000
    )
    refine_truncation_m: float = setting(
        0.10,
        "outline farther than this from a silhouette's edge is an outlier, at first",
        least=0.001,
        most=10.0,
    )
    refine_truncation_end_m: float = setting(
        0.035, "the same, in the last iteration", least=0.001, most=10.0
    )
    refine_sigma_m: float = setting(
        0.01, "noise believed of a silhouette's edge, for refinement", least=1e-4, most=1.0
    )
    refine_prior: float = setting(
        4.0,
        "spread of the belief about the predicted pose, in published spreads",
        least=0.01,
        most=1e6,
    )
    limb_spread: float = setting(
        4.0,
        "with refinement: spread of each limb's own small swarm, in published spreads",
        least=0.01,
        most=100.0,
    )
    min_improvement: float = setting(
        0.001,
        "with refinement: how much f must rise for a swarm's result to be taken",
        least=0.0,
        most=2.0,
    )
    prediction: float = setting(
        0.6,
        "share of the last change of pose that is expected again; 0 = zero motion",
        least=0.0,
        most=1.0,
    )
    smoothing: str = setting(
        "none",
        "one_euro: results pass a causal filter that calms what stands; none",
        choices=("none", "one_euro"),
    )
    search_again: bool = setting(
        True, "look for a body anew that has been lost for a tenth of a second"
    )
    fit_shape: bool = setting(
        True,
        "fit the body's sections to the first frame's silhouettes, unless the subject has them",
    )
    fit_lengths: bool = setting(
        True,
        "with fit_shape: fit lengths that were not measured, and the sections with them, to the "
        "first tracked frames",
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
    update: str = setting(
        "iteration",
        "when a swarm's best is updated; particle: as printed in SPPSO",
        choices=UPDATES,
    )
    sigma_scale: float = setting(
        0.5, "factor of the published spreads of the search", least=0.01, most=100.0
    )
    sigma_rate_max: float = setting(
        6.0,
        "spreads grow with the time between frames up to this many 60ths of a second",
        least=1.0,
        most=1000.0,
    )
    angle_sigma: float = setting(
        0.0,
        "least spread of every angle, rad, at any rate; 0: each angle has its own, of the body",
        least=0.0,
        most=3.0,
    )
    partition: str = setting(
        "soft",
        "of sppso's and hmcpso's steps; soft: what earlier steps found joins with a small spread; "
        "hard: it stays",
        choices=("soft", "hard"),
    )
    sppso_stages: str = setting(
        "two",
        "steps of sppso: two (root, then everything, as published), three (root; torso and head; "
        "everything) or global (everything at once)",
        choices=("two", "three", "global"),
    )
    hierarchy: str = setting(
        "six",
        "steps of hpso and hmcpso: six (root, torso and head, limbs), or twelve as HPSO's own",
        choices=("six", "twelve"),
    )
    soft_factor: float = setting(
        10.0, "soft partition: spreads of what joins are divided by this", least=1.0, most=1e6
    )
    sub_swarms: int = setting(3, "hmcpso, mcpso: sub-swarms beside the master", least=1, most=1000)
    inertia_max: float = setting(
        2.0, "inertia of the first move, of every swarm but sppso's", least=0.01, most=10.0
    )
    inertia_min: float = setting(0.1, "inertia of the last move", least=0.001, most=10.0)
    acceleration: float = setting(
        2.05, "pull of a particle's own best and of its swarm's best", least=0.0, most=10.0
    )
    migration: float = setting(
        2.0, "hmcpso, mcpso: pull of the sub-swarms' best on the master", least=0.0, most=10.0
    )
    master_term: str = setting(
        "printed",
        "hmcpso, mcpso: pull of the master's best; weighted: times the migration factor",
        choices=MASTER_TERMS,
    )
    layers: int = setting(
        0, "apf: layers; 0: six if they share the budget out evenly, else five", least=0, most=100
    )
    survival: float = setting(
        0.5, "apf: share of the particles that survives a layer", least=0.01, most=1.0
    )
    layer_shrink: float = setting(
        0.5, "apf: factor of the noise's variance from layer to layer", least=0.01, most=1.0
    )
    sharpness: float = setting(
        200.0, "pf: likelihood is exp(-sharpness cost)", least=0.01, most=1e6
    )
    estimate: str = setting(
        "mean", "apf, pf: weighted mean of the particles, or the best one", choices=ESTIMATES
    )
    cost: str = setting(
        "overlap",
        "overlap: what f = f_s + f_e lacks; H-MCPSO's costs: one_sided: body pixels that are not "
        "observed; bidirectional: these and observed pixels without body",
        choices=COSTS,
    )
    edge_weight: float = setting(0.0, "weight of f_e beside f_s", least=0.0, most=100.0)
    edge_rule: str = setting(
        "outline",
        "model edges that are sampled: sides: all; visible: those no nearer part hides; outline: "
        "those on the outline of the whole body",
        choices=tuple(EDGE_RULES),
    )
    edge_term: str = setting(
        "ssd", "f_e from edge strengths M: 1 - mean (1 - M)², or mean M", choices=EDGE_TERMS
    )
    edge_spacing_px: float = setting(
        5.0, "distance of edge samples along a side", least=0.5, most=100.0
    )
    edge_step_px: float = setting(
        2.0, "outline: how far outside a sample must be free of the body", least=0.5, most=50.0
    )
    full_frame_every: int = setting(
        30,
        "while the person is tracked, images are looked at around the predicted body only, and "
        "each camera's whole image every so many frames (it does not change the pose); 1 = always",
        least=1,
        most=100000,
    )
    region_margin_m: float = setting(
        0.15,
        "how far around the predicted body images are looked at, at the body; more where frames "
        "are further apart",
        least=0.0,
        most=100.0,
    )
    component_margin_px: int = setting(
        0,
        "silhouette components that come no nearer to the predicted body than this are left out",
        least=0,
        most=10000,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inertia_min > self.inertia_max:
            raise ConfigError(
                f"inertia_min: got {self.inertia_min:g}, expected at most inertia_max, "
                f"{self.inertia_max:g}"
            )

    @classmethod
    def settings(cls) -> tuple[Setting, ...]:
        """All settings, in order."""
        return tuple(
            Setting(
                f.name,
                type(f.default),
                f.default if f.default is not MISSING else None,
                f.metadata.get("doc", ""),
                f.metadata.get("choices"),
            )
            for f in fields(cls)
        )

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any], preset: str | None = None) -> Self:
        """A configuration of a preset (named in the values or given) and the values given.

        Raises:
            ConfigError: an unknown key, naming the nearest known one, or an impossible value.
        """
        known = {f.name for f in fields(cls)}
        for key in values:
            if key not in known:
                raise ConfigError(f"unknown setting {key!r}{nearest(str(key), known)}")
        name = values.get("preset", preset or "tuned")
        if not isinstance(name, str) or name not in PRESETS:
            raise ConfigError(f"preset is {name!r}, expected one of {', '.join(PRESETS)}")
        optimizer = values.get("optimizer", "sppso")
        own: dict[str, Any] = {}
        # Anything else is refused with the other values.
        if isinstance(optimizer, str) and optimizer in PAPERS:
            own = {"evaluations": own_evaluations(optimizer)}
            if name == "paper":
                own.update(PAPERS[optimizer])
        return cls(**{**PRESETS[name], **own, **values, "preset": name})

    def as_mapping(self) -> dict[str, Any]:
        """All settings by name, as `from_mapping` takes them."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def nearest(name: str, known: "set[str] | frozenset[str]") -> str:
    """', did you mean ...?' if a known name is near enough, else nothing."""
    from difflib import get_close_matches

    close = get_close_matches(name, sorted(known), n=1)
    return f", did you mean {close[0]!r}?" if close else ""
