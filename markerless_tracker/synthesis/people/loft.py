"""Surfaces from sections: rings of superelliptic points along a line, bound to a skeleton."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from markerless_tracker.body.model import IntArray
from markerless_tracker.geometry import FloatArray

AROUND = 20
"""Corners of a section."""
SPACING_M = 0.028
"""Distance of the rings along a line."""

# Share of the ease by which cloth hangs below the middle of what it covers: on top it lies closer.
_HANG = 0.8

Binding = Callable[[FloatArray], FloatArray]
"""Points (n, 3) in the rest pose to weights (n, f) of the frames."""


@dataclass(frozen=True)
class Section:
    """One section of a loft.

    Attributes:
        centre: (3,) m, rest pose.
        radii_m: to the front, back, left and right.
        ease_m: how far cloth stands off what it covers.
    """

    centre: FloatArray
    radii_m: tuple[float, float, float, float]
    ease_m: float = 0.0


@dataclass
class Surface:
    """Triangles in the rest pose, bound to frames.

    Attributes:
        vertices: (k, 3) m.
        weights: (k, f) of the frames; rows sum to 1.
        axis: (k, 3) unit, direction of the line that the vertex belongs to.
        slack_m: (k,) how far cloth hangs below the middle of what it covers.
        part: (k,) index of the part that gives the colour.
        triangles: (m, 3).
    """

    vertices: list[FloatArray] = field(default_factory=list)
    weights: list[FloatArray] = field(default_factory=list)
    axis: list[FloatArray] = field(default_factory=list)
    slack_m: list[FloatArray] = field(default_factory=list)
    part: list[IntArray] = field(default_factory=list)
    triangles: list[IntArray] = field(default_factory=list)
    count: int = 0

    def loft(
        self,
        part: int,
        sections: Sequence[Section],
        front: FloatArray,
        binding: Binding,
        *,
        exponent: float = 2.0,
        ripple_m: float = 0.0,
        rng: np.random.Generator | None = None,
        spacing_m: float = SPACING_M,
    ) -> None:
        """Add a closed tube through sections, smooth between them.

        Args:
            part: gives the colour.
            sections: at least two, along a line that does not bend sharply.
            front: (3,) direction that `radii_m` call front; their left is line x front.
            binding: weights of the points.
            exponent: of the superellipses.
            ripple_m: standard deviation of folds, whose phases come from `rng`.
            rng: source of the folds.
            spacing_m: distance of rings.
        """
        centres, radii, ease = _dense(sections, spacing_m)
        axes = np.gradient(centres, axis=0)
        axes /= np.linalg.norm(axes, axis=1)[:, None]
        ahead = front - (axes @ front)[:, None] * axes
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        left = np.cross(axes, ahead)
        angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
        x, y = (np.sign(f) * np.abs(f) ** (2.0 / exponent) for f in (np.cos(angle), np.sin(angle)))
        radius_x = np.where(x > 0.0, radii[:, :1], radii[:, 1:2])
        radius_y = np.where(y > 0.0, radii[:, 2:3], radii[:, 3:])
        stretch = 1.0 + _folds(len(centres), ripple_m, ease, radii.mean(axis=1), rng)
        points = (
            centres[:, None]
            + (stretch * radius_x * x)[..., None] * ahead[:, None]
            + (stretch * radius_y * y)[..., None] * left[:, None]
        )
        rings = len(points)
        flat = np.concatenate([points.reshape(-1, 3), centres[[0, -1]]])
        first, last = rings * AROUND, rings * AROUND + 1
        here, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
        a, b = (np.arange(rings - 1)[:, None] * AROUND + k for k in (here, after))
        sides = np.concatenate(
            [np.stack([a, b, b + AROUND], -1), np.stack([a, b + AROUND, a + AROUND], -1)]
        ).reshape(-1, 3)
        top = (rings - 1) * AROUND
        caps = np.concatenate(
            [
                np.column_stack([after, here, np.full(AROUND, first)]),
                np.column_stack([top + here, top + after, np.full(AROUND, last)]),
            ]
        )
        self._add(
            part, flat, binding(flat),
            np.concatenate([axes.repeat(AROUND, axis=0), axes[[0, -1]]]),
            _HANG * np.concatenate([ease.repeat(AROUND), ease[[0, -1]]]),
            np.concatenate([sides, caps]),
        )  # fmt: skip

    def ellipsoid(
        self,
        part: int,
        centre: FloatArray,
        radii_m: Sequence[float],
        binding: Binding,
        *,
        exponent: float = 2.0,
    ) -> None:
        """Add an ellipsoid with radii along x (forward), y and z of the rest pose."""
        height = np.cos(np.linspace(0.03 * np.pi, 0.97 * np.pi, 9))
        sections = []
        for z in height[::-1]:
            wide = (1.0 - abs(z) ** exponent) ** (1.0 / exponent)
            depth, width = radii_m[0] * wide, radii_m[1] * wide
            sections.append(
                Section(centre + [0.0, 0.0, radii_m[2] * z], (depth, depth, width, width))
            )
        self.loft(part, sections, np.array([1.0, 0.0, 0.0]), binding, exponent=exponent)

    def recolour(self, part: int, chosen: NDArray[np.bool_]) -> None:
        """Give some vertices (k,) of what was added last to another part."""
        self.part[-1][chosen] = part

    def _add(
        self, part: int, vertices: FloatArray, weights: FloatArray, axis: FloatArray,
        slack: FloatArray, triangles: IntArray,
    ) -> None:  # fmt: skip
        self.vertices.append(vertices)
        self.weights.append(weights)
        self.axis.append(axis)
        self.slack_m.append(slack)
        self.part.append(np.full(len(vertices), part))
        self.triangles.append(triangles + self.count)
        self.count += len(vertices)


def _dense(
    sections: Sequence[Section], spacing_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres (r, 3), radii (r, 4) and ease (r,) of rings at a distance, monotone in between."""
    centres = np.array([s.centre for s in sections], dtype=float)
    values = np.column_stack([centres, [s.radii_m for s in sections], [s.ease_m for s in sections]])
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-4))])
    count = max(len(sections), int(np.ceil(along[-1] / spacing_m)) + 1)
    dense = PchipInterpolator(along, values, axis=0)(np.linspace(0.0, along[-1], count))
    return dense[:, :3], np.maximum(dense[:, 3:7], 1e-4), dense[:, 7]


def _folds(
    rings: int,
    ripple_m: float,
    ease: FloatArray,
    radius: FloatArray,
    rng: np.random.Generator | None,
) -> FloatArray:
    """Relative change (r, AROUND) of the radii: waves around and along the line."""
    if ripple_m <= 0.0 or rng is None:
        return np.zeros((rings, AROUND))
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    along = SPACING_M * np.arange(rings)[:, None]
    total = np.zeros((rings, AROUND))
    for around, wavelength in ((1, 0.35), (2, 0.22), (3, 0.13), (4, 0.09)):
        phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        total += np.sin(around * angle + phase[0] + 0.8 * np.sin(7.0 * along)) * np.sin(
            2.0 * np.pi * along / wavelength + phase[1]
        )
    # Folds do not go through what the cloth covers.
    most = 0.8 * ease / radius
    return np.clip(ripple_m * total / radius[:, None], -most[:, None], 2.0 * most[:, None] + 0.02)
