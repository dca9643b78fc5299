"""The unclothed surface: trunk, head, limbs, hands and feet of a sampled person.

Radii are shares of the stature, near the means of adults' girths; sections are superelliptic and
not symmetric front to back.
"""

import numpy as np

from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.loft import Section, Surface
from markerless_tracker.synthesis.people.rest import Rest
from markerless_tracker.synthesis.people.spec import PersonSpec

FORWARD = np.array([1.0, 0.0, 0.0])

# Height above the hips in trunk lengths; front, back, sides; how far the belly stands out there.
_TRUNK = (
    (-0.16, 0.040, 0.046, 0.070, 0.0, 0.0),
    (-0.06, 0.056, 0.068, 0.094, 0.2, 0.0),
    (0.06, 0.060, 0.072, 0.100, 0.6, 0.0),
    (0.22, 0.060, 0.058, 0.090, 1.0, 0.0),
    (0.38, 0.058, 0.050, 0.082, 0.8, 0.0),
    (0.55, 0.062, 0.056, 0.088, 0.3, 0.4),
    (0.72, 0.066, 0.062, 0.096, 0.0, 1.0),
    (0.86, 0.056, 0.062, 0.098, 0.0, 0.3),
    (0.95, 0.042, 0.054, 0.078, 0.0, 0.0),
    (1.02, 0.034, 0.040, 0.046, 0.0, 0.0),
)
# Share of the thigh, then of the calf; front, back, sides.
_THIGH = (
    (-0.10, 0.046, 0.052, 0.050), (0.10, 0.050, 0.052, 0.050), (0.50, 0.046, 0.042, 0.043),
    (0.85, 0.036, 0.034, 0.034),
)  # fmt: skip
_CALF = (
    (0.0, 0.036, 0.033, 0.033), (0.15, 0.031, 0.037, 0.033), (0.32, 0.029, 0.042, 0.034),
    (0.60, 0.025, 0.031, 0.026), (0.85, 0.021, 0.023, 0.020), (1.02, 0.023, 0.026, 0.021),
)  # fmt: skip
_UPPER_ARM = (
    (-0.10, 0.026, 0.026, 0.022), (0.05, 0.034, 0.033, 0.031), (0.30, 0.031, 0.031, 0.028),
    (0.80, 0.026, 0.026, 0.024),
)  # fmt: skip
_FOREARM = (
    (0.0, 0.026, 0.026, 0.025), (0.25, 0.028, 0.027, 0.026), (0.60, 0.023, 0.022, 0.021),
    (1.0, 0.018, 0.017, 0.015),
)  # fmt: skip
# Share of the hand's length; thickness, width.
_HAND = ((0.0, 0.013, 0.017), (0.30, 0.014, 0.024), (0.70, 0.011, 0.023), (1.0, 0.006, 0.013))
# Forward of the ankle, height of the instep above the sole, half width; shares of the stature.
_FOOT = (
    (-0.040, 0.026, 0.014), (-0.028, 0.045, 0.018), (0.000, 0.060, 0.020), (0.030, 0.048, 0.023),
    (0.070, 0.030, 0.027), (0.095, 0.021, 0.025), (0.112, 0.012, 0.015),
)  # fmt: skip
ANKLE_HEIGHT = 0.045
"""Height of the ankle above the bare sole, share of the stature."""


def trunk_sections(
    rest: Rest, spec: PersonSpec, *, lowest: float = -9.0, ease: tuple[float, float] = (0.0, 0.0)
) -> list[Section]:
    """Sections of the trunk from bottom to top.

    Args:
        rest: the skeleton at rest.
        spec: the person.
        lowest: height above the hips, in trunk lengths, below which sections are left out.
        ease: how far cloth stands off up to the waist, and at the neck, m.
    """
    s, g = spec.stature_m, spec.girth
    length = rest.joints["Neck"][2] - rest.joints["Pelvis"][2]
    sections = []
    for t, front, back, side, belly, bust in _TRUNK:
        if t < lowest:
            continue
        off = float(np.interp(t, [0.5, 1.0], ease))
        wide = spec.shoulders if t > 0.5 else 1.0
        ahead = s * g * front + belly * spec.belly_m + bust * spec.bust_m + off
        side_m = s * g * wide * side + 0.5 * belly * spec.belly_m + off
        sections.append(
            Section(
                rest.joints["Pelvis"] + [0.0, 0.0, t * length],
                (ahead, s * g * back + off, side_m, side_m),
                off,
            )
        )
    return sections


def leg_sections(
    rest: Rest, spec: PersonSpec, side: str, *, until: float = 1.02,
    ease: tuple[float, float] = (0.0, 0.0),
) -> list[Section]:  # fmt: skip
    """Sections of a leg from the hip down.

    Args:
        rest: the skeleton at rest.
        spec: the person.
        side: l or r.
        until: end of the sections: 0.5 at the knee, 1 at the ankle.
        ease: how far cloth stands off at the hip and at the end, m.
    """
    hip, knee, ankle = (rest.joints[side.upper() + name] for name in ("Hip", "Knee", "Ankle"))
    rows = [(0.5 * t, hip + t * (knee - hip), r) for t, *r in _THIGH]
    rows += [(0.5 + 0.5 * t, knee + t * (ankle - knee), r) for t, *r in _CALF]
    return _limb(rows, spec.stature_m * spec.girth * spec.legs, until, ease)


def arm_sections(
    rest: Rest, spec: PersonSpec, side: str, *, until: float = 1.0,
    ease: tuple[float, float] = (0.0, 0.0),
) -> list[Section]:  # fmt: skip
    """Sections of an arm from the shoulder to the wrist; arguments as of `leg_sections`."""
    shoulder, elbow, wrist = (
        rest.joints[side.upper() + name] for name in ("Shoulder", "Elbow", "Wrist")
    )
    rows = [(0.5 * t, shoulder + t * (elbow - shoulder), r) for t, *r in _UPPER_ARM]
    rows += [(0.5 + 0.5 * t, elbow + t * (wrist - elbow), r) for t, *r in _FOREARM]
    return _limb(rows, spec.stature_m * spec.girth * spec.arms, until, ease)


def _limb(
    rows: list[tuple[float, FloatArray, list[float]]], scale: float, until: float,
    ease: tuple[float, float],
) -> list[Section]:  # fmt: skip
    at = np.array([row[0] for row in rows])
    values = np.array([[*row[1], *row[2]] for row in rows])
    ends = np.append(at[at < until - 0.02], until)
    sections = []
    for t in ends:
        x, y, z, front, back, wide = (float(np.interp(t, at, column)) for column in values.T)
        off = float(np.interp(t, [0.0, until], ease))
        sections.append(
            Section(
                np.array([x, y, z]),
                (scale * front + off, scale * back + off, scale * wide + off, scale * wide + off),
                off,
            )
        )
    return sections


def add_head(surface: Surface, rest: Rest, spec: PersonSpec, skin: int) -> None:
    """Neck, skull, jaw and nose."""
    s, neck, top = spec.stature_m, rest.joints["Neck"], rest.joints["Head"]
    height = float(top[2] - neck[2])
    radius = 0.033 * s * spec.girth
    around = [
        Section(neck + [x * s, 0.0, z * height], (r * radius,) * 4)
        for x, z, r in ((-0.006, -0.10, 1.25), (-0.004, 0.05, 1.0), (0.004, 0.45, 0.98))
    ]
    surface.loft(skin, around, FORWARD, rest.trunk())
    depth, width, high = spec.head
    middle = neck + [0.010 * s, 0.0, 0.62 * height]
    skull = (0.056 * s * depth, 0.045 * s * width, 0.385 * height * high)
    middle[2] = top[2] - skull[2]
    surface.ellipsoid(skin, middle, skull, rest.head(), exponent=2.2)
    jaw = middle + [0.020 * s, 0.0, -0.50 * skull[2]]
    surface.ellipsoid(skin, jaw, (0.034 * s, 0.034 * s, 0.30 * height), rest.head())
    nose = middle + [skull[0] + 0.002 * s, 0.0, -0.22 * skull[2]]
    surface.ellipsoid(skin, nose, (0.010 * s, 0.008 * s, 0.016 * s), rest.head())


def add_hand(surface: Surface, rest: Rest, spec: PersonSpec, side: str, skin: int) -> None:
    """A flat hand with a thumb, palm towards the thigh."""
    elbow, wrist = (rest.joints[side.upper() + name] for name in ("Elbow", "Wrist"))
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    length, s = rest.body.lengths_m["hand"] * 0.92, spec.stature_m * spec.arms
    sections = [
        Section(wrist + t * length * along, (s * wide, s * wide, s * thick, s * thick))
        for t, thick, wide in _HAND
    ]
    surface.loft(skin, sections, FORWARD, rest.arm(side), exponent=2.5, spacing_m=0.02)
    base = wrist + 0.25 * length * along + 0.018 * s * FORWARD
    thumb = [
        Section(base + t * length * (0.35 * along + 0.2 * FORWARD), (0.009 * s * r,) * 4)
        for t, r in ((0.0, 1.0), (0.5, 1.0), (1.0, 0.6))
    ]
    surface.loft(skin, thumb, FORWARD, rest.arm(side), spacing_m=0.02)


def add_foot(surface: Surface, rest: Rest, spec: PersonSpec, side: str, shoe: int) -> None:
    """A shoe with a flat sole below the ankle."""
    ankle, s = rest.joints[side.upper() + "Ankle"], spec.stature_m
    scale = rest.body.lengths_m["foot"] / (0.142 * s)
    ground = ankle[2] - ANKLE_HEIGHT * s - spec.sole_m
    sections = []
    for ahead, high, wide in _FOOT:
        half = 0.5 * (high * s + spec.sole_m + spec.shoe_ease_m)
        side_m = s * wide + spec.shoe_ease_m
        # The line runs forward; "front" is up.
        centre = np.array([ankle[0] + ahead * s * scale, ankle[1], ground + half])
        sections.append(Section(centre, (half, half, side_m, side_m)))
    up = np.array([0.0, 0.0, 1.0])
    surface.loft(shoe, sections, up, rest.foot(side), exponent=3.2, spacing_m=0.02)
