"""Body descriptions (YAML): frames as chains of moves, lengths, cones, markers."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from markerless_tracker.body.files import read_yaml
from markerless_tracker.body.schema import check_description
from markerless_tracker.errors import BodyModelError
from markerless_tracker.resources import config_dir

_NUMBER = r"\d+(?:\.\d*)?|\.\d+"
_MOVE = re.compile(
    rf"([rt][xyz]|s[xy])\(\s*([+-]?)\s*(?:({_NUMBER})\s*\*\s*)?([A-Za-z_]\w*|{_NUMBER})\s*\)"
)


@dataclass(frozen=True)
class Move:
    """One elementary move of a chain: ``tz(-0.4*torso)`` translates along z by -0.4 'torso'.

    ``sx(a) sy(b)``, always together, is a swing: one rotation by the rotation vector (a, b, 0).
    """

    kind: str
    factor: float
    argument: str | float


@dataclass(frozen=True)
class BodyDescription:
    """A body as declared by its YAML file; `build_body` makes a `BodyModel` for a subject."""

    name: str
    lengths: Mapping[str, Mapping[str, Any]]
    parameters: Mapping[str, Mapping[str, Any]]
    frames: Mapping[str, Mapping[str, Any]]
    root: str
    markers: Mapping[str, Mapping[str, Any]]
    cones: Mapping[str, Mapping[str, Any]]
    collisions: tuple[tuple[str, str], ...]
    subspaces: Mapping[str, tuple[str, ...]]
    hierarchies: Mapping[str, tuple[tuple[str, ...], ...]]


def parse_chain(text: str, where: str) -> tuple[Move, ...]:
    """Parse moves such as ``ry(180) ty(+l_hip) tz(0.4*torso) rx(-l_hip_x)``.

    Raises:
        BodyModelError: a part of the text is no move.
    """
    if _MOVE.sub("", text).strip():
        raise BodyModelError(
            f"{where}: chain {text!r} holds {_MOVE.sub('', text).strip()!r}, "
            "expected moves such as rx(90) tz(-length) ry(parameter) or sx(first) sy(second)"
        )
    moves = []
    for kind, sign, factor, argument in _MOVE.findall(text):
        number = argument[0].isdigit() or argument[0] == "."
        signed = (-1.0 if sign == "-" else 1.0) * float(factor or 1.0)
        moves.append(Move(kind, signed, float(argument) if number else argument))
    kinds = [move.kind for move in moves]
    firsts = [i for i, kind in enumerate(kinds) if kind == "sx"]
    if kinds.count("sy") != len(firsts) or any(kinds[i + 1 : i + 2] != ["sy"] for i in firsts):
        raise BodyModelError(f"{where}: chain {text!r}: expected sx(first) sy(second) together")
    return tuple(moves)


def read_description(path: Path) -> BodyDescription:
    """Read a body description file.

    Raises:
        BodyModelError: the file cannot be read, is no YAML, or fails `check_description`.
    """
    data = read_yaml(path, "body description")
    check_description(data, str(path))
    return BodyDescription(
        name=data["name"],
        lengths=data["lengths"],
        parameters=data["parameters"],
        frames=data["frames"],
        root=data["root"],
        markers=data["markers"],
        cones=data["cones"],
        collisions=tuple((a, b) for a, b in data["collisions"]),
        subspaces={name: tuple(members) for name, members in data["subspaces"].items()},
        hierarchies={
            name: tuple(map(tuple, steps)) for name, steps in data.get("hierarchies", {}).items()
        },
    )


@cache
def shipped_lengths() -> frozenset[str]:
    """Names of the lengths of all shipped bodies."""
    files = sorted((config_dir() / "bodies").glob("*.yaml"))
    return frozenset(name for file in files for name in read_description(file).lengths)
