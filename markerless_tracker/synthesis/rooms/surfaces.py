"""Floor and walls as one sheet of texels: their paint, and where points of the room lie on it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from markerless_tracker.geometry import FloatArray
from markerless_tracker.synthesis.rooms.spec import RoomSpec, SurfaceSpec

TEXEL_M = 0.01
HALF_M = 6.5
"""The sheet shows the floor, and the walls' length, this far from the room's middle."""
HEIGHT_M = 3.0
SIZE = round(2.0 * HALF_M / TEXEL_M)
RISE = round(HEIGHT_M / TEXEL_M)

Picture = NDArray[np.float32]


@dataclass(frozen=True)
class Plane:
    """A floor or wall: points whose coordinate `axis` is `level_m`.

    Attributes:
        axis: 0..2.
        level_m: where it is.
        inward: sign of the direction into the room.
        row: first row of the plane on the sheet.
    """

    axis: int
    level_m: float
    inward: float
    row: int

    @property
    def normal(self) -> FloatArray:
        """Unit normal (3,) into the room."""
        normal = np.zeros(3)
        normal[self.axis] = self.inward
        return normal

    def texels(self, points: FloatArray) -> FloatArray:
        """Places (..., 2) as (column, row) on the sheet of points (..., 3) of the plane."""
        if self.axis == 2:
            across, along = points[..., 0] + HALF_M, points[..., 1] + HALF_M
        else:
            across, along = points[..., 1 - self.axis] + HALF_M, points[..., 2]
        return np.stack([across / TEXEL_M - 0.5, self.row + along / TEXEL_M - 0.5], axis=-1)

    @property
    def rows(self) -> slice:
        """The plane's rows on the sheet."""
        return slice(self.row, self.row + (SIZE if self.axis == 2 else RISE))


def planes_of(room: RoomSpec) -> tuple[Plane, ...]:
    """The floor, then the walls along -x, +x, -y, +y."""
    planes = [Plane(2, 0.0, 1.0, 0)]
    for i, level in enumerate(room.walls_m):
        planes.append(Plane(i // 2, level, 1.0 if i % 2 == 0 else -1.0, SIZE + i * RISE))
    return tuple(planes)


def painted(room: RoomSpec) -> Picture:
    """The sheet (rows, columns, 3) BGR under a light of 1."""
    return np.concatenate(
        [_surface(room.floor, SIZE)] + [_surface(wall, RISE) for wall in room.walls]
    )


def _surface(spec: SurfaceSpec, rows: int) -> Picture:
    rng = np.random.default_rng(spec.seed)
    pattern = _pattern(spec.pattern, rng)[:rows]
    spread = float(pattern.std())
    if spread > 0.0:
        pattern = (pattern - pattern.mean()) * np.float32(spec.contrast / spread)
    colour = np.array(spec.colour, dtype=np.float32)
    # Texture changes brightness: its colour is the surface's.
    factor = np.clip(1.0 + pattern / np.float32(128.0), 0.15, 2.5)
    sheet = factor[..., None] * colour
    for _ in range(spec.posters):
        _poster(sheet, rng)
    return np.asarray(sheet, dtype=np.float32)


def _pattern(kind: str, rng: np.random.Generator) -> Picture:
    """A pattern (SIZE, SIZE) of any spread."""
    if kind == "carpet":
        return _noise(rng, (650, 1300)) + 0.4 * _noise(rng, (30,))
    if kind == "blotches":
        return _noise(rng, (8, 20, 50, 130))
    if kind == "planks":
        return _boards(rng, int(rng.integers(9, 22)), int(rng.integers(90, 220)))
    if kind == "tiles":
        size = int(rng.integers(25, 100))
        return _boards(rng, size, size, shift=False) + 0.5 * _noise(rng, (20, 60, 200))
    return 0.6 * _noise(rng, (5, 12)) + 0.4 * _noise(rng, (400,))


def _noise(rng: np.random.Generator, cells: tuple[int, ...]) -> Picture:
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for count in cells:
        coarse = rng.standard_normal((count, count), dtype=np.float32)
        total += cv2.resize(coarse, (SIZE, SIZE), interpolation=cv2.INTER_CUBIC)
    return total


def _boards(rng: np.random.Generator, wide: int, long: int, *, shift: bool = True) -> Picture:
    """Boards or tiles, each of its own brightness, with dark joints; sizes in texels."""
    v, u = np.indices((SIZE, SIZE))
    row = v // wide
    offset = rng.integers(0, long, SIZE // wide + 2)[row] if shift else 0
    column = (u + offset) // long
    shades = rng.standard_normal((int(row.max()) + 1, int(column.max()) + 1))
    joint = (v % wide < 1) | ((u + offset) % long < 1)
    return np.asarray(shades[row, column] - 2.5 * joint, dtype=np.float32) + 0.3 * _noise(
        rng, (60,)
    )


def _poster(sheet: Picture, rng: np.random.Generator) -> None:
    """A picture, door or shelf on a wall whose rows rise from the floor."""
    wide, high = (int(v) for v in rng.uniform(0.3, 1.3, 2) / TEXEL_M)
    low = int(rng.uniform(0.0, 1.8) / TEXEL_M) if rng.uniform() < 0.8 else 0
    left = int(rng.integers(0, SIZE - wide))
    part = sheet[low : low + high, left : left + wide]
    colour = rng.uniform(25.0, 225.0, 3)
    if rng.uniform() < 0.5:
        colour = 0.6 * colour.mean() + 0.4 * colour
    part[:] = 0.4 * colour
    part[3:-3, 3:-3] = colour
    for _ in range(int(rng.integers(0, 6))):
        y, x = int(rng.integers(0, max(high - 20, 1))), int(rng.integers(0, max(wide - 20, 1)))
        part[y + 3 : y + 3 + high // 5, x + 3 : x + 3 + wide // 4] = rng.uniform(25.0, 225.0, 3)
