"""Groups of the tracker's settings."""

from dataclasses import dataclass

from markerless_tracker.errors import ConfigError
from markerless_tracker.fitness import EDGE_RULES, EDGE_TERMS
from markerless_tracker.imaging.settings import EdgeMapSettings
from markerless_tracker.optim import ESTIMATES, MASTER_TERMS, UPDATES
from markerless_tracker.settings import SettingsGroup, setting


@dataclass(frozen=True, kw_only=True)
class EdgeSettings(EdgeMapSettings):
    """The edge map, and the model edges that are compared with it."""

    rule: str = setting(
        "outline",
        "model edges that are sampled: sides: all; visible: those that no nearer part hides; "
        "outline: those on the outline of the whole body",
        choices=tuple(EDGE_RULES),
    )
    term: str = setting(
        "ssd", "f_e from edge strengths M: 1 - mean (1 - M)², or mean M", choices=EDGE_TERMS
    )
    spacing_px: float = setting(5.0, "distance of edge samples along a side", least=0.5, most=100.0)
    step_px: float = setting(
        2.0, "outline: distance outside a sample at which no body may be", least=0.5, most=50.0
    )


@dataclass(frozen=True, kw_only=True)
class RefineSettings(SettingsGroup):
    """Contour refinement, and the limbs' own swarms that complement it."""

    NAME = "refine"

    iterations: int = setting(
        4,
        "iterations of a contour refinement; a second one follows swarms, or a pose that moved far",
        least=1,
        most=1000,
    )
    truncation_m: float = setting(
        0.10,
        "outline points farther than this from a silhouette's contour are outliers, in the first "
        "iteration",
        least=0.001,
        most=10.0,
    )
    truncation_end_m: float = setting(
        0.035,
        "outline points farther than this from a silhouette's contour are outliers, in the last "
        "iteration",
        least=0.001,
        most=10.0,
    )
    sigma_m: float = setting(
        0.01, "standard deviation of a silhouette's contour, for refinement", least=1e-4, most=1.0
    )
    floor_sd_m: float = setting(
        0.01,
        "with refinement: standard deviation of how far the body reaches below the floor, which "
        "is the plane z = 0; 0: no floor",
        least=0.0,
        most=1.0,
    )
    prior: float = setting(
        4.0,
        "sigma of the prior about the predicted pose, as a factor of the published one",
        least=0.01,
        most=1e6,
    )
    swarms: str = setting(
        "needed",
        "which frames swarms search beside the refinement; needed: those that the refinement "
        "explains worse than the track's usual, or with a limb in doubt; always: all",
        choices=("needed", "always"),
    )
    limb_sigma: float = setting(
        4.0,
        "with refinement: sigma of each limb's own small swarm, as a factor of the published one",
        least=0.01,
        most=100.0,
    )


@dataclass(frozen=True, kw_only=True)
class SigmaSettings(SettingsGroup):
    """Standard deviations of the first sample of a search (sigma)."""

    NAME = "sigma"

    scale: float = setting(
        0.5, "factor of the published sigma of the search", least=0.01, most=100.0
    )
    rate_max: float = setting(
        6.0,
        "sigma grows with the time between frames up to this many 60ths of a second",
        least=1.0,
        most=1000.0,
    )
    angle: float = setting(
        0.0,
        "least sigma of every angle, rad, at any rate; 0: each angle has that of the body alone",
        least=0.0,
        most=3.0,
    )
    soft_factor: float = setting(
        10.0,
        "soft partition: divisor of the sigma of parameters of earlier steps",
        least=1.0,
        most=1e6,
    )


@dataclass(frozen=True, kw_only=True)
class SppsoSettings(SettingsGroup):
    """SPPSO."""

    NAME = "sppso"

    stages: str = setting(
        "two",
        "two (root, then everything, as published), three (root; torso and head; "
        "everything) or global (everything at once)",
        choices=("two", "three", "global"),
    )
    update: str = setting(
        "iteration",
        "when a swarm's best is updated; particle: after each, as printed in SPPSO",
        choices=UPDATES,
    )


@dataclass(frozen=True, kw_only=True)
class PsoSettings(SettingsGroup):
    """Every swarm but SPPSO's: PSO, HPSO, MCPSO, H-MCPSO, GLPSO."""

    NAME = "pso"

    inertia_max: float = setting(2.0, "inertia in the first iteration", least=0.01, most=10.0)
    inertia_min: float = setting(0.1, "inertia in the last iteration", least=0.001, most=10.0)
    acceleration: float = setting(
        2.05,
        "acceleration towards a particle's own best and its swarm's best",
        least=0.0,
        most=10.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inertia_min > self.inertia_max:
            raise ConfigError(
                f"pso.inertia_min: got {self.inertia_min:g}, expected at most inertia_max, "
                f"{self.inertia_max:g}"
            )


@dataclass(frozen=True, kw_only=True)
class HmcpsoSettings(SettingsGroup):
    """H-MCPSO; HPSO uses its hierarchy, too, and MCPSO its sub-swarms."""

    NAME = "hmcpso"

    hierarchy: str = setting(
        "six",
        "steps of hpso and hmcpso: six (root, torso and head, limbs), or twelve as HPSO's own",
        choices=("six", "twelve"),
    )
    sub_swarms: int = setting(3, "hmcpso, mcpso: sub-swarms beside the master", least=1, most=1000)
    migration: float = setting(
        2.0,
        "hmcpso, mcpso: acceleration of the master towards the sub-swarms' best",
        least=0.0,
        most=10.0,
    )
    master_term: str = setting(
        "printed",
        "hmcpso, mcpso: term of the master's best; weighted: times the migration factor",
        choices=MASTER_TERMS,
    )


@dataclass(frozen=True, kw_only=True)
class ApfSettings(SettingsGroup):
    """Annealed particle filter."""

    NAME = "apf"

    layers: int = setting(
        0, "layers; 0: six if the budget is a multiple of six, else five", least=0, most=100
    )
    survival: float = setting(
        0.5, "fraction of the particles that survives a layer", least=0.01, most=1.0
    )
    layer_shrink: float = setting(
        0.5, "factor of the noise's variance from layer to layer", least=0.01, most=1.0
    )
    estimate: str = setting(
        "mean", "weighted mean of the particles, or the best one", choices=ESTIMATES
    )


@dataclass(frozen=True, kw_only=True)
class PfSettings(SettingsGroup):
    """Particle filter."""

    NAME = "pf"

    sharpness: float = setting(200.0, "likelihood is exp(-sharpness cost)", least=0.01, most=1e6)
    estimate: str = setting(
        "mean", "weighted mean of the particles, or the best one", choices=ESTIMATES
    )


@dataclass(frozen=True, kw_only=True)
class RegionSettings(SettingsGroup):
    """Region of each image that is processed while the person is tracked."""

    NAME = "region"

    full_frame_every: int = setting(
        30,
        "while the person is tracked, images are processed around the predicted body only, and "
        "with background.follow_s each camera's whole image once in this many frames (the pose is "
        "the same, but for specks of silhouette away from the body); 1 = whole images always",
        least=1,
        most=100000,
    )
    margin_m: float = setting(
        0.08,
        "margin around the predicted body within which images are processed; it grows with the "
        "time between frames",
        least=0.0,
        most=100.0,
    )
    component_margin_px: int = setting(
        0,
        "components of the silhouette farther than this from the predicted body are left out",
        least=0,
        most=10000,
    )
