"""Reading a body's declarative description: frames as chains of moves, lengths, cones, markers."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from markerless_tracker.errors import BodyModelError

_NUMBER = r"\d+(?:\.\d*)?|\.\d+"
_MOVE = re.compile(
    rf"([rt][xyz])\(\s*([+-]?)\s*(?:({_NUMBER})\s*\*\s*)?([A-Za-z_]\w*|{_NUMBER})\s*\)"
)
_SECTIONS = (
    "name lengths parameters frames root markers cones collisions subspaces".split()
)


@dataclass(frozen=True)
class Move:
    """One elementary move of a chain: ``tz(-0.4*torso)`` is kind 'tz', factor -0.4, argument 'torso'."""

    kind: str
    factor: float
    argument: str | float


@dataclass(frozen=True)
class BodyDescription:
    """A body as its YAML file declares it; `BodyModel` is what it becomes for one subject."""

    name: str
    lengths: Mapping[str, Mapping[str, Any]]
    parameters: Mapping[str, Mapping[str, Any]]
    frames: Mapping[str, Mapping[str, Any]]
    root: str
    markers: Mapping[str, Mapping[str, Any]]
    cones: Mapping[str, Mapping[str, Any]]
    collisions: tuple[tuple[str, str], ...]
    subspaces: Mapping[str, tuple[str, ...]]


def parse_chain(text: str, where: str) -> tuple[Move, ...]:
    """Parse moves such as ``ry(180) ty(+l_hip) tz(0.4*torso) rx(-l_hip_x)``.

    Raises:
        BodyModelError: something in the text is no move.
    """
    if _MOVE.sub("", text).strip():
        raise BodyModelError(
            f"{where}: chain {text!r} holds {_MOVE.sub('', text).strip()!r}, "
            "expected moves such as rx(90) tz(-length) ry(parameter)"
        )
    moves = []
    for kind, sign, factor, argument in _MOVE.findall(text):
        number = argument[0].isdigit() or argument[0] == "."
        signed = (-1.0 if sign == "-" else 1.0) * float(factor or 1.0)
        moves.append(Move(kind, signed, float(argument) if number else argument))
    return tuple(moves)


def read_description(path: Path) -> BodyDescription:
    """Read a body description file.

    Raises:
        BodyModelError: the file cannot be read, is not YAML, or a section is missing or unknown.
    """
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError) as error:
        first = str(error).splitlines()[0]
        raise BodyModelError(f"{path}: cannot read the body description: {first}") from error
    if not isinstance(data, dict):
        raise BodyModelError(f"{path}: expected a mapping with {', '.join(_SECTIONS)}")
    wrong = sorted(set(data) ^ set(_SECTIONS))
    if wrong:
        raise BodyModelError(
            f"{path}: sections {', '.join(map(str, wrong))} missing or unknown, "
            f"expected exactly {', '.join(_SECTIONS)}"
        )
    return BodyDescription(
        name=str(data["name"]),
        lengths=data["lengths"],
        parameters=data["parameters"],
        frames=data["frames"],
        root=str(data["root"]),
        markers=data["markers"],
        cones=data["cones"],
        collisions=tuple((str(a), str(b)) for a, b in data["collisions"]),
        subspaces={name: tuple(members) for name, members in data["subspaces"].items()},
    )
