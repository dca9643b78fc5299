"""Every sampled value of a generated scene, and the seeds that are set aside."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from markerless_tracker.errors import ConfigError
from markerless_tracker.synthesis.people.postures import POSTURES
from markerless_tracker.synthesis.people.spec import PersonSpec, sample_person
from markerless_tracker.synthesis.rooms.spec import (
    CameraSpec,
    Colour,
    RoomSpec,
    SensorSpec,
    sample_cameras,
    sample_room,
    sample_sensor,
)

DEVELOPMENT_SEEDS = tuple(range(1000, 1040))
"""Scenes on which settings may be chosen."""
TEST_SEEDS = tuple(range(7000, 7040))
"""Scenes for testing only: no setting may be chosen on them."""

SIZE_PX = (640, 480)
MOTIONS = ("walk", "balance", "jog", "stand")

_SKIN: tuple[Colour, ...] = (
    (165.0, 190.0, 225.0), (135.0, 165.0, 212.0), (95.0, 125.0, 175.0), (55.0, 75.0, 115.0),
    (38.0, 50.0, 78.0),
)  # fmt: skip
_HAIR: tuple[Colour, ...] = (
    (22.0, 22.0, 25.0), (28.0, 38.0, 58.0), (50.0, 75.0, 110.0), (95.0, 140.0, 175.0),
    (150.0, 152.0, 155.0),
)  # fmt: skip
_CLOTHES: tuple[Colour, ...] = (
    (35.0, 35.0, 38.0), (85.0, 55.0, 42.0), (190.0, 190.0, 192.0), (120.0, 120.0, 122.0),
    (45.0, 50.0, 175.0), (60.0, 120.0, 65.0), (150.0, 90.0, 40.0), (95.0, 140.0, 165.0),
)  # fmt: skip


@dataclass(frozen=True)
class PaintSpec:
    """The colour of a part of a person.

    Attributes:
        like: "floor" or "wall" where the part looks as that does, on average around the person;
            "" where it has a colour of its own.
        ratio: brightness relative to what it looks like; 1 for the same.
        offset: grey levels added to each channel.
        colour: under a light of 1, where it has a colour of its own.
        stripe: relative amplitude of a pattern across the cloth; `stripe_m`: its wavelength.
    """

    like: str
    ratio: float
    offset: Colour
    colour: Colour
    stripe: float
    stripe_m: float


@dataclass(frozen=True)
class SceneSpec:
    """A generated scene; everything else follows from it.

    Attributes:
        seed: of all of it, of the noise as well.
        person: sizes, garments and hair.
        paint: colours of the parts `people.person.PARTS`.
        room: surfaces and lamps.
        cameras: cam01.. .
        sensor: what the cameras share.
        motion: what the person does: one of `MOTIONS`.
        posture: another thing to do, one of `people.postures.POSTURES`; where it is "seated" a
            chair stands in the room.
        place_m: where on the floor.
    """

    seed: int
    person: PersonSpec
    paint: Mapping[str, PaintSpec]
    room: RoomSpec
    cameras: tuple[CameraSpec, ...]
    sensor: SensorSpec
    motion: str
    posture: str
    place_m: tuple[float, float]

    def values(self) -> dict[str, Any]:
        """All values as plain dictionaries, lists, numbers and strings."""
        return asdict(self)


def sample_scene(seed: int, size_px: tuple[int, int] = SIZE_PX) -> SceneSpec:
    """Draw a scene; the size of the images changes nothing else.

    Raises:
        ConfigError: the seed is negative.
    """
    if seed < 0:
        raise ConfigError(f"seed of a scene is {seed}, expected 0 or more")
    person, paint, room, cameras, sensor, action = (
        np.random.default_rng([seed, 100 + part]) for part in range(6)
    )
    place = action.uniform(-0.25, 0.25, 2)
    return SceneSpec(
        seed=seed,
        person=sample_person(person),
        paint=_sample_paint(paint),
        room=sample_room(room),
        cameras=sample_cameras(cameras, size_px),
        sensor=sample_sensor(sensor, size_px),
        motion=str(action.choice(MOTIONS, p=[0.6, 0.15, 0.15, 0.1])),
        posture=str(action.choice(list(POSTURES))),
        place_m=(float(place[0]), float(place[1])),
    )


def _sample_paint(rng: np.random.Generator) -> dict[str, PaintSpec]:
    """Colours of the parts: often the floor's or a wall's, as they are, brighter or darker."""
    skin = _SKIN[int(rng.integers(len(_SKIN)))]
    return {
        "skin": _paint(rng, skin, spread=0.08, floor=0.0, wall=0.08),
        "hair": _paint(rng, _HAIR[int(rng.integers(len(_HAIR)))], spread=0.2, floor=0.0, wall=0.15),
        "upper": _paint(rng, _cloth(rng), spread=0.25, floor=0.06, wall=0.40, stripes=0.3),
        "lower": _paint(rng, _cloth(rng), spread=0.25, floor=0.55, wall=0.05, stripes=0.1),
        "shoes": _paint(rng, _cloth(rng), spread=0.3, floor=0.30, wall=0.0),
    }


def _cloth(rng: np.random.Generator) -> Colour:
    if rng.uniform() < 0.25:
        blue, green, red = (float(v) for v in rng.uniform(25.0, 215.0, 3))
        return blue, green, red
    return _CLOTHES[int(rng.integers(len(_CLOTHES)))]


def _paint(
    rng: np.random.Generator, colour: Colour, *, spread: float, floor: float, wall: float,
    stripes: float = 0.0,
) -> PaintSpec:  # fmt: skip
    chance = rng.uniform()
    like = "floor" if chance < floor else "wall" if chance < floor + wall else ""
    # Two thirds of them as they are; the others as a shadow would make them, or brighter.
    kind = rng.uniform()
    ratio = (
        1.0 if kind < 0.66 else rng.uniform(0.55, 0.85) if kind < 0.88 else rng.uniform(1.15, 1.35)
    )
    offset = rng.normal(0.0, 2.0, 3)
    level = float(np.exp(rng.normal(0.0, spread)))
    striped = rng.uniform() < stripes
    amplitude, wavelength = rng.uniform(0.08, 0.4), rng.uniform(0.03, 0.15)
    return PaintSpec(
        like=like,
        ratio=float(ratio),
        offset=(float(offset[0]), float(offset[1]), float(offset[2])),
        colour=(colour[0] * level, colour[1] * level, colour[2] * level),
        stripe=float(amplitude) if striped else 0.0,
        stripe_m=float(wavelength),
    )
