"""Sampled values of a generated person: sizes, garments and their fit.

Statures and their spread are those of European adults; segment lengths scatter about the means of
de Leva (1996) as they do among people of one stature.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from markerless_tracker.body import load_description

STATURE_M = {"female": (1.64, 0.065), "male": (1.77, 0.070)}
"""Mean and standard deviation of adults' statures."""
PROPORTIONS = 0.04
"""Standard deviation of a length among people of one stature, as a share of it."""
ASYMMETRY = 0.008
"""Standard deviation of the factor of one side's length; left and right are drawn separately."""

HAIR = ("none", "short", "full", "long", "bun")
LOWER = ("trousers", "shorts", "skirt")
UPPER = ("shirt", "jacket")


_SLEEVES, _SLEEVE_SHARES = (0.0, 0.35, 0.45, 0.97), (0.1, 0.3, 0.3, 0.3)


@dataclass(frozen=True)
class PersonSpec:
    """One person, all lengths in m, factors about 1.

    Attributes:
        sex: female or male; only the means of sizes depend on it.
        stature_m: height without shoes.
        lengths_m: segment lengths by the names of a body description.
        girth: factor of all radii; `legs` and `arms` come on top of it.
        legs, arms: factors of the limbs' radii.
        shoulders: factor of the chest's width.
        belly_m: how far the belly stands out.
        bust_m: how far the chest stands out.
        exponent: of the superelliptic sections of trunk and limbs, 2 for an ellipse.
        head: factors of the head's depth, width and height.
        hair: one of `HAIR`; `hair_m`: its thickness.
        lower: one of `LOWER`; `lower_length`: its length, 1 reaches the ankle, 0.5 the knee.
        leg_ease_m, hem_ease_m: how far the cloth stands off the thigh, and off the leg at its hem.
        upper: one of `UPPER`; `upper_length`: above 0.1 its hem below the hips' height, in trunk
            lengths; from 0.05 to 0.1 the hem is 0.06 below it, under 0.05 it is 0.22 above it.
        trunk_ease_m: how far the cloth stands off the trunk at its hem; less than 16 mm is drawn as
            16 mm.
        sleeve: length of the sleeve, 1 reaches the wrist, 0 is none.
        sleeve_ease_m: how far the sleeve stands off the arm.
        wrinkle_m: standard deviation of the folds.
        sole_m: thickness of the soles; `shoe_ease_m`: how far shoes stand off the feet.
        seed: of the folds.
    """

    sex: str
    stature_m: float
    lengths_m: Mapping[str, float]
    girth: float
    legs: float
    arms: float
    shoulders: float
    belly_m: float
    bust_m: float
    exponent: float
    head: tuple[float, float, float]
    hair: str
    hair_m: float
    lower: str
    lower_length: float
    leg_ease_m: float
    hem_ease_m: float
    upper: str
    upper_length: float
    trunk_ease_m: float
    sleeve: float
    sleeve_ease_m: float
    wrinkle_m: float
    sole_m: float
    shoe_ease_m: float
    seed: int


def sample_person(rng: np.random.Generator) -> PersonSpec:
    """Draw a person."""
    sex = str(rng.choice(["female", "male"]))
    female = sex == "female"
    mean, sd = STATURE_M[sex]
    stature = float(np.clip(rng.normal(mean, sd), 1.48, 2.00))
    hair = str(
        rng.choice(HAIR, p=[0.05, 0.2, 0.2, 0.35, 0.2] if female else [0.15, 0.5, 0.3, 0.05, 0.0])
    )
    lower = str(rng.choice(LOWER, p=[0.62, 0.13, 0.25] if female else [0.8, 0.2, 0.0]))
    length = {
        "trousers": rng.uniform(0.90, 1.0),
        "shorts": rng.uniform(0.30, 0.52),
        "skirt": rng.uniform(0.34, 0.75),
    }[lower]
    loose = rng.uniform() < 0.4
    upper = str(rng.choice(UPPER, p=[0.7, 0.3]))
    jacket = upper == "jacket"
    return PersonSpec(
        sex=sex,
        stature_m=stature,
        lengths_m=_lengths(stature, rng),
        girth=_factor(rng, 0.94 if female else 0.98, 0.09),
        legs=_factor(rng, 1.02, 0.06),
        arms=_factor(rng, 0.92 if female else 1.0, 0.08),
        shoulders=_factor(rng, 0.94 if female else 1.02, 0.04),
        belly_m=float(max(0.0, rng.normal(0.012, 0.022))),
        bust_m=float(rng.uniform(0.01, 0.035) if female else rng.uniform(0.0, 0.01)),
        exponent=float(rng.uniform(1.9, 3.2)),
        head=(_factor(rng, 1.0, 0.04), _factor(rng, 1.0, 0.05), _factor(rng, 1.0, 0.03)),
        hair=hair,
        hair_m=float(rng.uniform(0.004, 0.012) if hair == "short" else rng.uniform(0.012, 0.03)),
        lower=lower,
        lower_length=float(length),
        leg_ease_m=float(rng.uniform(0.015, 0.035) if loose else rng.uniform(0.004, 0.014)),
        hem_ease_m=float(rng.uniform(0.03, 0.06) if loose else rng.uniform(0.008, 0.03)),
        upper=upper,
        upper_length=float(rng.uniform(0.15, 0.45) if jacket else rng.uniform(-0.02, 0.22)),
        trunk_ease_m=float(rng.uniform(0.02, 0.05) if jacket else rng.uniform(0.008, 0.04)),
        sleeve=float(rng.uniform(0.9, 1.0) if jacket else rng.choice(_SLEEVES, p=_SLEEVE_SHARES)),
        sleeve_ease_m=float(rng.uniform(0.012, 0.028) if jacket else rng.uniform(0.005, 0.022)),
        wrinkle_m=float(rng.uniform(0.0005, 0.0032)),
        sole_m=float(rng.uniform(0.008, 0.035)),
        shoe_ease_m=float(rng.uniform(0.003, 0.010)),
        seed=int(rng.integers(2**31)),
    )  # fmt: skip


@cache
def _lengths_of_people() -> Mapping[str, Mapping[str, Any]]:
    return load_description("person35").lengths


def _factor(rng: np.random.Generator, mean: float, sd: float) -> float:
    """A factor about a mean, within 2.5 standard deviations."""
    return float(mean * np.exp(sd * np.clip(rng.standard_normal(), -2.5, 2.5)))


def _lengths(stature_m: float, rng: np.random.Generator) -> dict[str, float]:
    """Segment lengths of a person, both sides nearly alike."""
    lengths: dict[str, float] = {}
    common: dict[str, float] = {}
    for name, entry in _lengths_of_people().items():
        sided = name[:2] in ("l_", "r_")
        key = name[2:] if sided else name
        if key not in common:
            common[key] = _factor(rng, 1.0, PROPORTIONS)
        side = _factor(rng, 1.0, ASYMMETRY) if sided else 1.0
        lengths[name] = float(entry["stature"]) * stature_m * common[key] * side
    return lengths
