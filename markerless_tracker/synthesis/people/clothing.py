"""Garments and hair: surfaces that stand off the flesh and hang from it."""

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.flesh import (
    FORWARD,
    arm_sections,
    leg_sections,
    trunk_sections,
)
from markerless_tracker.synthesis.people.loft import Section, Surface
from markerless_tracker.synthesis.people.rest import Rest
from markerless_tracker.synthesis.people.spec import PersonSpec

_LEAST_EASE_M, _WAIST_EASE_M = 0.004, 0.008


def add_lower(
    surface: Surface, rest: Rest, spec: PersonSpec, cloth: int, rng: np.random.Generator
) -> None:
    """Trousers, shorts or a skirt, up to the waist."""
    ease = min(spec.leg_ease_m, _WAIST_EASE_M)
    waist = [s for s in trunk_sections(rest, spec, ease=(ease, ease))
             if s.centre[2] < rest.loins[2] + 0.06]  # fmt: skip
    surface.loft(
        cloth, waist, FORWARD, rest.trunk(), exponent=spec.exponent,
        ripple_m=spec.wrinkle_m, rng=rng,
    )  # fmt: skip
    if spec.lower == "skirt":
        _add_skirt(surface, rest, spec, cloth, rng)
        return
    for side in "lr":
        sections = leg_sections(
            rest, spec, side, until=spec.lower_length, ease=(spec.leg_ease_m, spec.hem_ease_m)
        )
        surface.loft(
            cloth, sections, FORWARD, rest.leg(side), exponent=spec.exponent,
            ripple_m=spec.wrinkle_m, rng=rng,
        )  # fmt: skip


def _add_skirt(
    surface: Surface, rest: Rest, spec: PersonSpec, cloth: int, rng: np.random.Generator
) -> None:
    """One tube around both legs, wider towards its hem."""
    hips = rest.joints["Pelvis"]
    low = float(rest.joints["LHip"][2] - rest.joints["LAnkle"][2]) * spec.lower_length
    top = trunk_sections(rest, spec, ease=(spec.leg_ease_m, spec.leg_ease_m))[2]
    sections = []
    for t in (0.0, 0.35, 0.7, 1.0):
        flare = 1.0 + (0.1 + 4.0 * spec.hem_ease_m) * t
        radii = np.array(top.radii_m) * flare
        sections.append(
            Section(hips + [0.0, 0.0, -t * low], (*radii.tolist(),), spec.leg_ease_m * (1.0 - t))
        )
    surface.loft(
        cloth, sections, FORWARD, rest.hanging(), exponent=2.2,
        ripple_m=2.0 * spec.wrinkle_m, rng=rng,
    )  # fmt: skip


def add_upper(
    surface: Surface, rest: Rest, spec: PersonSpec, cloth: int, rng: np.random.Generator
) -> None:
    """A shirt or jacket with its sleeves; cloth hangs straight from the chest to the hem."""
    ease = max(spec.trunk_ease_m, _WAIST_EASE_M + 0.008)
    sections = trunk_sections(rest, spec, lowest=-0.1, ease=(ease, _LEAST_EASE_M))
    length = rest.joints["Neck"][2] - rest.joints["Pelvis"][2]
    hem = sections[0]
    if spec.upper_length > 0.1:
        wide = tuple(1.04 * r for r in sections[1].radii_m)
        low = rest.joints["Pelvis"] + [0.0, 0.0, -spec.upper_length * length]
        sections.insert(0, Section(low, (wide[0], wide[1], wide[2], wide[3]), hem.ease_m))
    elif spec.upper_length < 0.05:
        sections = sections[2:]
    surface.loft(
        cloth, sections, FORWARD, rest.hanging() if spec.upper_length > 0.1 else rest.trunk(),
        exponent=spec.exponent, ripple_m=spec.wrinkle_m, rng=rng,
    )  # fmt: skip
    scale = spec.stature_m * spec.girth
    for side in "lr":
        neck, shoulder = rest.joints["Neck"], rest.joints[side.upper() + "Shoulder"]
        slope = [
            Section(
                neck + t * (shoulder - neck) + [0.0, 0.0, z * scale],
                (r * scale, r * scale, 0.8 * r * scale, 0.8 * r * scale),
            )
            for t, z, r in ((0.1, -0.016, 0.038), (0.5, -0.008, 0.036), (0.95, -0.002, 0.034))
        ]
        surface.loft(cloth, slope, FORWARD, rest.shoulder(side))
        surface.ellipsoid(
            cloth, shoulder, (0.030 * scale + _LEAST_EASE_M,) * 3, rest.shoulder(side), exponent=2.0
        )
        if spec.sleeve > 0.0:
            sections = arm_sections(
                rest, spec, side, until=spec.sleeve,
                ease=(0.5 * spec.sleeve_ease_m + _LEAST_EASE_M, spec.sleeve_ease_m),
            )  # fmt: skip
            surface.loft(
                cloth, sections, FORWARD, rest.arm(side), exponent=min(spec.exponent, 2.6),
                ripple_m=spec.wrinkle_m, rng=rng,
            )  # fmt: skip


def add_hair(surface: Surface, rest: Rest, spec: PersonSpec, hair: int) -> None:
    """Hair: a cap over the skull, long hair down to the shoulders, or a bun."""
    if spec.hair == "none":
        return
    s, top = spec.stature_m, rest.joints["Head"]
    height = float(top[2] - rest.joints["Neck"][2])
    depth, width, high = spec.head
    skull = np.array([0.056 * s * depth, 0.045 * s * width, 0.385 * height * high])
    middle = np.array([0.010 * s, 0.0, 0.0]) + [rest.joints["Neck"][0], 0.0, top[2] - skull[2]]
    off = spec.hair_m
    # Shifted back and up: it leaves the face free.
    cap = middle + [-0.016 * s, 0.0, 0.14 * skull[2]]
    radii = (
        float(skull[0]) + off - 0.004 * s, float(skull[1]) + off, 0.86 * float(skull[2]) + off,
    )  # fmt: skip
    surface.ellipsoid(hair, cap, radii, rest.head(), exponent=2.2)
    back: FloatArray = middle + [-0.045 * s, 0.0, 0.0]
    if spec.hair == "long":
        fall = [
            Section(back + [x * s, 0.0, z * s], (0.020 * s, 0.014 * s, r * s, r * s))
            for x, z, r in ((0.02, 0.03, 0.036), (0.0, -0.03, 0.045), (-0.012, -0.10, 0.042),
                            (-0.02, -0.15, 0.026))
        ]  # fmt: skip
        surface.loft(hair, fall, FORWARD, rest.head(), exponent=2.4)
    elif spec.hair == "bun":
        surface.ellipsoid(hair, back + [-0.022 * s, 0.0, 0.03 * s], (0.026 * s,) * 3, rest.head())
