"""Parameters of a node: the names and values a user gave, checked, and what is in effect."""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from markerless_tracker.errors import ConfigError
from markerless_tracker.settings import Setting

ROS_OWN = ("use_sim_time", "start_type_description_service")
"""Parameters that every ROS node has."""


def given_parameters(node: Node) -> dict[str, Any]:
    """What a user gave to a node that declares its parameters from overrides, by name."""
    return {
        name: parameter.value
        for name, parameter in node.get_parameters_by_prefix("").items()
        if name not in ROS_OWN and not name.startswith("qos_overrides.")
    }


def declare_effective(
    node: Node,
    values: Mapping[str, Any],
    lines: Mapping[str, str],
    settings: Iterable[Setting] = (),
) -> None:
    """Replace what was given by what is in effect, with a description each, fixed from here on.

    Args:
        node: the node.
        values: every parameter's value; None where there is none.
        lines: a line about each.
        settings: whose ranges and choices the descriptors have.
    """
    held = {setting.name: setting for setting in settings}
    for name in given_parameters(node):
        node.undeclare_parameter(name)
    for name, value in values.items():
        descriptor = ParameterDescriptor(
            description=lines.get(name, ""), read_only=True, dynamic_typing=value is None
        )
        if name in held:
            _hold(descriptor, held[name])
        node.declare_parameter(name, value, descriptor, ignore_override=True)


def check_names(given: Iterable[str], known: Sequence[str]) -> None:
    """Make sure that all names given are parameters: rclpy itself ignores the others.

    Raises:
        ConfigError: one is not; names the nearest that is.
    """
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(known)}"
            raise ConfigError(f"parameter {name!r} is unknown, {hint}")


def present(given: Mapping[str, Any]) -> dict[str, Any]:
    """The values that say something: neither None nor an empty text."""
    return {name: value for name, value in given.items() if value is not None and value != ""}


def attribute_lines(owner: type) -> dict[str, str]:
    """What a class' docstring says about each attribute, by name (lines ``name: what it is``)."""
    attributes = (owner.__doc__ or "").partition("Attributes:")[2]
    pairs = (line.strip().partition(": ") for line in attributes.splitlines())
    return {name: said for name, colon, said in pairs if colon and name.isidentifier()}


def _hold(descriptor: ParameterDescriptor, setting: Setting) -> None:
    """Put a setting's range and choices into its parameter's descriptor."""
    if setting.choices:
        descriptor.additional_constraints = f"one of {', '.join(setting.choices)}"
    if setting.min is None or setting.max is None:
        return
    if setting.type is int:
        bounds = (int(setting.min), int(setting.max))
        descriptor.integer_range = [IntegerRange(from_value=bounds[0], to_value=bounds[1], step=1)]
    else:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(setting.min), to_value=float(setting.max))
        ]


def text(name: str, value: Any) -> str:
    """The value, if it is a text.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if not isinstance(value, str):
        raise ConfigError(f"{name}: got {value!r}, expected a text")
    return value


def flag(name: str, value: Any) -> bool:
    """The value, if it is true or false.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if not isinstance(value, bool):
        raise ConfigError(f"{name}: got {value!r}, expected true or false")
    return value


def names(name: str, value: Any) -> tuple[str, ...]:
    """The value, if it is a list of distinct names; a single name is a list of one.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    values: tuple[Any, ...] = ()
    if isinstance(value, str):
        values = (value,)
    elif isinstance(value, Sequence) and not isinstance(value, bytes):
        values = tuple(value)
    if not values or not all(isinstance(v, str) and v for v in values):
        raise ConfigError(f"{name}: got {value!r}, expected a list of names such as [cam01, cam02]")
    if len(set(values)) != len(values):
        raise ConfigError(f"{name}: got {value!r}, expected distinct names")
    return values


def count(name: str, value: Any, least: int, most: int) -> int:
    """The value, if it is a whole number in that range.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ConfigError(f"{name}: got {value!r}, expected a whole number from {least} to {most}")
    return value


def number(name: str, value: Any, least: float, most: float) -> float:
    """The value, if it is a number in that range.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
        raise ConfigError(f"{name}: got {value!r}, expected a number from {least:g} to {most:g}")
    return float(value)
