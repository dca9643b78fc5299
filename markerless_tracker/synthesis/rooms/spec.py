"""Sampled values of a generated room: surfaces, lamps, cameras and sensor."""

from dataclasses import dataclass

import numpy as np

Colour = tuple[float, float, float]
"""Blue, green, red."""

PATTERNS = ("plain", "carpet", "planks", "tiles", "blotches")


@dataclass(frozen=True)
class SurfaceSpec:
    """A floor or a wall.

    Attributes:
        colour: mean, grey levels 0..255 under a light of 1.
        pattern: one of `PATTERNS`.
        contrast: standard deviation of the pattern, grey levels where the mean is 128.
        posters: number of pictures on it.
        seed: of pattern and posters.
    """

    colour: Colour
    pattern: str
    contrast: float
    posters: int
    seed: int


@dataclass(frozen=True)
class LampSpec:
    """A lamp.

    Attributes:
        place_m: middle, world frame.
        radius_m: of the shining disc: the penumbra's width grows with it.
        samples: points of it that cast shadows.
        share: part of the floor's light at the room's middle that comes from it.
        tint: factor of each channel.
    """

    place_m: tuple[float, float, float]
    radius_m: float
    samples: int
    share: float
    tint: Colour


@dataclass(frozen=True)
class RoomSpec:
    """A room; its floor is z = 0.

    Attributes:
        walls_m: places of the walls along -x, +x, -y, +y.
        floor: the floor.
        walls: the four walls in that order.
        lamps: the lamps; the rest of the light comes from everywhere.
        ambient: part of the floor's light that casts no shadow.
        ambient_tint: factor of each channel of it.
    """

    walls_m: tuple[float, float, float, float]
    floor: SurfaceSpec
    walls: tuple[SurfaceSpec, ...]
    lamps: tuple[LampSpec, ...]
    ambient: float
    ambient_tint: Colour


@dataclass(frozen=True)
class CameraSpec:
    """A camera: where it stands, where it looks, and its lens.

    Attributes:
        eye_m, target_m: world frame.
        focal_px: focal length.
        distortion: k1 k2 p1 p2 k3.
        gains: factor of each channel, besides the sensor's.
        blur_px: standard deviation of the lens' blur.
        vignette: part of the light that the corners lack.
    """

    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    focal_px: float
    distortion: tuple[float, ...]
    gains: Colour
    blur_px: float
    vignette: float


@dataclass(frozen=True)
class SensorSpec:
    """What all cameras share.

    Attributes:
        size_px: (width, height).
        level: mean grey level of the empty room, which the exposure is set for, before the tone
            curve, clipping and greying.
        cast: factor of each channel.
        gamma: exponent of the tone curve, 1 for none.
        noise: standard deviation at a grey level of 128.
        grey: whether images have one channel.
        drift: amplitude of the light's slow change, as a share; `drift_s`: its period.
    """

    size_px: tuple[int, int]
    level: float
    cast: Colour
    gamma: float
    noise: float
    grey: bool
    drift: float
    drift_s: float


def sample_room(rng: np.random.Generator) -> RoomSpec:
    """Draw a room; where the strongest lamp is hidden 0.4 to 0.8 of the floor's light is left."""
    floor = _surface(rng, _dull(rng, 60.0, 190.0), patterns=PATTERNS, most=25.0, posters=0)
    base = _dull(rng, 90.0, 210.0)
    other = _dull(rng, 90.0, 210.0)
    walls = tuple(
        _surface(
            rng, other if rng.uniform() < 0.3 else base,
            patterns=("plain", "plain", "blotches", "planks"), most=14.0,
            posters=int(rng.integers(0, 5)),
        )
        for _ in range(4)
    )  # fmt: skip
    west, east, south, north = (float(v) for v in rng.uniform(2.2, 5.5, 4))
    lamps, ambient, tint = _light(rng, min(west, east, south, north) + 0.3)
    return RoomSpec(
        walls_m=(-west, east, -south, north),
        floor=floor,
        walls=walls,
        lamps=lamps,
        ambient=ambient,
        ambient_tint=tint,
    )


def _light(rng: np.random.Generator, most_m: float) -> tuple[tuple[LampSpec, ...], float, Colour]:
    """The lamps, the ambient light and its tint; their shares sum to 1.

    Args:
        rng: source of everything.
        most_m: largest distance of a lamp from the room's middle: one that nearly touches a wall
            leaves nothing but a bright spot.
    """
    azimuth = rng.uniform(-np.pi, np.pi)
    distance, height = rng.uniform(0.8, min(most_m, 3.6)), rng.uniform(2.6, 4.6)
    hard = rng.uniform() < 0.5
    key_share = float(rng.uniform(0.18, 0.55))
    lamps = [
        LampSpec(
            (float(distance * np.cos(azimuth)), float(distance * np.sin(azimuth)), float(height)),
            float(rng.uniform(0.01, 0.06) if hard else rng.uniform(0.1, 0.6)),
            4 if hard else 12,
            key_share,
            _tint(rng, 0.035),
        )
    ]
    left = 1.0 - key_share
    if rng.uniform() < 0.55:
        azimuth += rng.uniform(0.5, 2.0 * np.pi - 0.5)
        distance = rng.uniform(0.8, min(most_m, 3.2))
        share = float(min(rng.uniform(0.08, 0.3), 0.8 * key_share, 0.6 * left))
        lamps.append(
            LampSpec(
                (
                    float(distance * np.cos(azimuth)), float(distance * np.sin(azimuth)),
                    float(rng.uniform(2.6, 4.2)),
                ),
                float(rng.uniform(0.03, 0.4)), 8, share, _tint(rng, 0.035),
            )
        )  # fmt: skip
        left -= share
    # A wide ceiling: the soft darkness where feet touch the floor.
    ceiling = float(left * rng.uniform(0.2, 0.5))
    x, y = (float(v) for v in rng.uniform(-0.5, 0.5, 2))
    tint = _tint(rng, 0.035)
    lamps.append(LampSpec((x, y, 3.0), 2.2, 16, ceiling, tint))
    return tuple(lamps), left - ceiling, tint


def sample_cameras(
    rng: np.random.Generator, size_px: tuple[int, int], count: int = 4
) -> tuple[CameraSpec, ...]:
    """Draw cameras around the middle, which see a person who walks there almost always whole."""
    start = rng.uniform(-np.pi, np.pi)
    cameras = []
    for i in range(count):
        azimuth = start + 2.0 * np.pi * (i + rng.uniform(-0.14, 0.14)) / count
        distance, height = rng.uniform(3.6, 5.2), rng.uniform(1.1, 2.6)
        x, y, z = (float(v) for v in rng.uniform([-0.1, -0.1, 0.80], [0.1, 0.1, 1.00]))
        # 2.9 m across the image's shorter side where the person is.
        focal = min(size_px) * distance / rng.uniform(2.75, 3.3)
        bend = rng.uniform(-0.16, 0.03)
        cameras.append(
            CameraSpec(
                eye_m=(
                    float(distance * np.cos(azimuth)), float(distance * np.sin(azimuth)),
                    float(height),
                ),
                target_m=(x, y, z),
                focal_px=float(focal),
                distortion=(
                    float(bend), float(-0.3 * bend), *(float(v) for v in rng.normal(0, 0.0006, 2)),
                    0.0,
                ),
                gains=_tint(rng, 0.02),
                blur_px=float(rng.uniform(0.2, 1.0)),
                vignette=float(rng.uniform(0.0, 0.18)),
            )
        )  # fmt: skip
    return tuple(cameras)


def sample_sensor(rng: np.random.Generator, size_px: tuple[int, int]) -> SensorSpec:
    """Draw what the cameras share."""
    return SensorSpec(
        size_px=size_px,
        level=float(rng.uniform(75.0, 150.0)),
        cast=_tint(rng, 0.045),
        gamma=float(rng.uniform(0.75, 1.05)),
        noise=float(np.exp(rng.uniform(0.0, np.log(6.0)))),
        grey=bool(rng.uniform() < 0.15),
        drift=float(rng.choice([0.0, rng.uniform(0.01, 0.08)])),
        drift_s=float(rng.uniform(5.0, 20.0)),
    )


def _surface(
    rng: np.random.Generator, colour: Colour, *, patterns: tuple[str, ...], most: float,
    posters: int,
) -> SurfaceSpec:  # fmt: skip
    return SurfaceSpec(
        colour=colour,
        pattern=str(rng.choice(patterns)),
        contrast=float(rng.uniform(0.0, most)),
        posters=posters,
        seed=int(rng.integers(2**31)),
    )


def _dull(rng: np.random.Generator, least: float, most: float) -> Colour:
    """A colour of rooms: its brightness even between two grey levels, its channels some % apart."""
    level = rng.uniform(least, most)
    blue, green, red = level * np.exp(rng.normal([-0.05, 0.0, 0.03], [0.08, 0.02, 0.06]))
    return float(blue), float(green), float(red)


def _tint(rng: np.random.Generator, sd: float) -> Colour:
    blue, green, red = np.exp(rng.normal(0.0, sd, 3))
    return float(blue), float(green), float(red)
