"""Structure of a body description: keys of each entry and types of their values."""

from collections.abc import Callable, Mapping
from typing import Any

from markerless_tracker.body.files import is_number
from markerless_tracker.errors import BodyModelError

Check = Callable[[Any], bool]


def _positive(value: Any) -> bool:
    return is_number(value) and bool(value > 0)


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, str) for item in value)


def _pair(value: Any) -> bool:
    return _texts(value) and len(value) == 2


def _range(value: Any) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(is_number(item) for item in value)
        and bool(value[0] < value[1])
    )


def _end(value: Any) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 4
        and all(is_number(item) for item in value)
        and min(value[:2]) > 0
    )


def _edges(value: Any) -> bool:
    return _texts(value) and set(value) <= {"sides", "top"}


# Requirements on a value, as text for messages and as a test.
_POSITIVE = ("a number above 0", _positive)
_NUMBER = ("a number", is_number)
_TEXT = ("text", _text)
_PAIR = ("two names", _pair)
_RANGE = ("two numbers, the lower one first", _range)
_END = ("[radius x, radius y, offset x, offset y] with positive radii", _end)
_EDGES = ("a list of 'sides' and 'top'", _edges)

# Keys of the entries of each section: required ones, then optional ones.
_ENTRIES: Mapping[str, tuple[Mapping[str, tuple[str, Check]], Mapping[str, tuple[str, Check]]]] = {
    "lengths": ({"stature": _POSITIVE}, {"markers": _PAIR}),
    "parameters": (
        {"sigma": _POSITIVE},
        {
            "neutral": _NUMBER,
            "prior_mean_deg": _NUMBER,
            "prior_sd_rad": _POSITIVE,
            "limits": _RANGE,
            "walking": _RANGE,
        },
    ),
    "frames": ({"parent": _TEXT, "chain": _TEXT}, {}),
    "markers": ({"frame": _TEXT}, {"chain": _TEXT}),
    "cones": (
        {"frame": _TEXT, "length": _TEXT, "start": _END, "end": _END},
        {"factor": _POSITIVE, "placement": _TEXT, "edges": _EDGES},
    ),
}
OPTIONAL = ("hierarchies",)
"""Sections that a description may have."""
SECTIONS = ("name", *_ENTRIES, "root", "collisions", "subspaces")
"""Sections that a description must have."""


def check_description(data: Any, where: str) -> None:
    """Check the structure of a description file.

    Args:
        data: the parsed file.
        where: names the file in messages.

    Raises:
        BodyModelError: a section, entry, key or value is missing, unknown or of the wrong kind; the
            message names it.
    """
    if not isinstance(data, dict):
        raise BodyModelError(f"{where}: expected a mapping with {', '.join(SECTIONS)}")
    _keys(data, SECTIONS, OPTIONAL, where)
    if not isinstance(data["name"], str):
        raise BodyModelError(f"{where}: name is {data['name']!r}, expected text")
    for section, (required, optional) in _ENTRIES.items():
        for name, entry in _mapping(data[section], f"{where}: {section}").items():
            here = f"{where}: {section}: {name}"
            _keys(_mapping(entry, here), tuple(required), tuple(optional), here)
            for key, value in entry.items():
                words, check = {**required, **optional}[key]
                if not check(value):
                    raise BodyModelError(f"{here}: {key} is {value!r}, expected {words}")
    if not _text(data["root"]) or data["root"] not in data["frames"]:
        raise BodyModelError(f"{where}: root is {data['root']!r}, expected the name of a frame")
    pairs = data["collisions"]
    if not isinstance(pairs, list) or not all(_pair(pair) for pair in pairs):
        raise BodyModelError(f"{where}: collisions is {pairs!r}, expected a list of pairs of cones")
    for name, members in _mapping(data["subspaces"], f"{where}: subspaces").items():
        if not _texts(members) or not members:
            raise BodyModelError(
                f"{where}: subspaces: {name} is {members!r}, expected a list of parameters"
            )
    if len(set(data["subspaces"].get("root", ()))) != 6:
        raise BodyModelError(f"{where}: subspaces: root needs six parameters")
    for name, steps in _mapping(data.get("hierarchies", {}), f"{where}: hierarchies").items():
        here = f"{where}: hierarchies: {name}"
        if not isinstance(steps, list) or not steps or not all(_texts(s) and s for s in steps):
            raise BodyModelError(
                f"{here} is {steps!r}, expected steps [subspace, subspaces added by a soft "
                "partition ...]"
            )
        for subspace in sum(steps, []):
            if subspace not in data["subspaces"]:
                raise BodyModelError(f"{here}: subspace {subspace!r} is not defined")


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise BodyModelError(f"{where} is {value!r}, expected a mapping of names")
    return value


def _keys(
    data: Mapping[Any, Any], required: tuple[str, ...], optional: tuple[str, ...], where: str
) -> None:
    missing = [key for key in required if key not in data]
    if missing:
        raise BodyModelError(f"{where}: {', '.join(missing)} missing")
    unknown = [str(key) for key in data if key not in (*required, *optional)]
    if unknown:
        raise BodyModelError(
            f"{where}: {', '.join(unknown)} unknown, expected {', '.join((*required, *optional))}"
        )
