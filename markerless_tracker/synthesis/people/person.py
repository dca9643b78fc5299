"""A generated person: its surface in the rest pose, and in any pose of its skeleton."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.people.clothing import add_hair, add_lower, add_upper
from markerless_tracker.synthesis.people.flesh import (
    FORWARD,
    add_foot,
    add_hand,
    add_head,
    arm_sections,
    leg_sections,
    trunk_sections,
)
from markerless_tracker.synthesis.people.loft import Surface
from markerless_tracker.synthesis.people.rest import Rest
from markerless_tracker.synthesis.people.skeleton import skeleton
from markerless_tracker.synthesis.people.spec import PersonSpec

PARTS = ("skin", "hair", "upper", "lower", "shoes")
"""Parts of the surface that have a colour each."""


@dataclass(frozen=True, eq=False)
class PosedSurface:
    """Triangles of a person at one time, world frame.

    Attributes:
        vertices: (k, 3) m.
        part: (k,) index in `PARTS`.
        triangles: (m, 3).
    """

    vertices: FloatArray
    part: IntArray
    triangles: IntArray


class Person:
    """A person's skeleton and surface.

    Args:
        spec: sizes, clothes and hair.

    Attributes:
        body: the skeleton.
        part: (k,) index in `PARTS` of every vertex.
        height_m: (k,) height of every vertex above the hips, at rest.
        triangles: (m, 3).

    Raises:
        BodyModelError: a length is missing or impossible.
    """

    def __init__(self, spec: PersonSpec) -> None:
        self.spec = spec
        self.body = skeleton(spec.lengths_m)
        self.rest = Rest.of(self.body)
        surface = self._dressed()
        self._vertices = np.concatenate(surface.vertices)
        self._weights = np.concatenate(surface.weights)
        self._axis = np.concatenate(surface.axis)
        self._slack = np.concatenate(surface.slack_m)
        self.part = np.concatenate(surface.part)
        self.height_m = self._vertices[:, 2]
        self.triangles = np.ascontiguousarray(np.concatenate(surface.triangles))

    def posed(self, pose: FloatArray) -> PosedSurface:
        """The surface at a pose (p,): linear blend skinning, then loose cloth hangs down."""
        return PosedSurface(self._posed(pose, slice(None)), self.part, self.triangles)

    def lowest_m(self, pose: FloatArray) -> float:
        """Height of the soles' lowest point at a pose (p,)."""
        return float(self._posed(pose, self._soles)[:, 2].min())

    def _posed(self, pose: FloatArray, chosen: IntArray | slice) -> FloatArray:
        moves = self.rest.moved(pose)
        blended = (self._weights[chosen] @ moves.reshape(len(moves), 12)).reshape(-1, 3, 4)
        rotation = blended[:, :, :3]
        vertices = np.einsum("nij,nj->ni", rotation, self._vertices[chosen]) + blended[:, :, 3]
        axis = np.einsum("nij,nj->ni", rotation, self._axis[chosen])
        axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-9)[:, None]
        # Gravity across the line that the cloth is around; along it the cloth does not slide.
        down = axis * axis[:, 2:]
        down[:, 2] -= 1.0
        return np.asarray(vertices + self._slack[chosen, None] * down)

    @cached_property
    def _soles(self) -> IntArray:
        return np.flatnonzero(self.part == PARTS.index("shoes"))

    def _dressed(self) -> Surface:
        spec, rest = self.spec, self.rest
        rng = np.random.default_rng(spec.seed)
        skin, hair, upper, lower, shoes = range(len(PARTS))
        surface = Surface()
        surface.loft(
            upper, trunk_sections(rest, spec), FORWARD, rest.trunk(), exponent=spec.exponent
        )
        for side in "lr":
            surface.loft(
                skin, leg_sections(rest, spec, side), FORWARD, rest.leg(side),
                exponent=min(spec.exponent, 2.5),
            )  # fmt: skip
            # Covered flesh has the cloth's colour: where a fold lets it through, it shows none.
            hip, ankle = (rest.joints[side.upper() + name][2] for name in ("Hip", "Ankle"))
            hem = hip - spec.lower_length * (hip - ankle)
            surface.recolour(lower, surface.vertices[-1][:, 2] > hem)
            surface.loft(skin, arm_sections(rest, spec, side), FORWARD, rest.arm(side))
            shoulder, wrist = (rest.joints[side.upper() + name] for name in ("Shoulder", "Wrist"))
            along = (surface.vertices[-1] - shoulder) @ (wrist - shoulder)
            within = along < spec.sleeve * float((wrist - shoulder) @ (wrist - shoulder))
            surface.recolour(upper, within)
            scale = spec.stature_m * spec.girth
            knee = rest.joints[side.upper() + "Knee"]
            # Keeps a bent knee round, where blended frames flatten it.
            surface.ellipsoid(
                lower if spec.lower_length > 0.55 and spec.lower != "skirt" else skin, knee,
                (0.033 * scale * spec.legs,) * 3, rest.leg(side),
            )  # fmt: skip
            elbow = rest.joints[side.upper() + "Elbow"]
            surface.ellipsoid(
                upper if spec.sleeve > 0.55 else skin, elbow,
                (0.025 * scale * spec.arms,) * 3, rest.arm(side),
            )  # fmt: skip
            add_hand(surface, rest, spec, side, skin)
            add_foot(surface, rest, spec, side, shoes)
        add_head(surface, rest, spec, skin)
        add_hair(surface, rest, spec, hair)
        add_lower(surface, rest, spec, lower, rng)
        add_upper(surface, rest, spec, upper, rng)
        return surface
