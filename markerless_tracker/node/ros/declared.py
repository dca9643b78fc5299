"""Parameters of a node: checks of the given names and values, declaration of those in effect."""

from array import array
from collections.abc import Collection, Iterable, Mapping, Sequence
from inspect import cleandoc
from textwrap import dedent
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from markerless_tracker.errors import ConfigError
from markerless_tracker.settings import Setting, similar

ROS_OWN = ("use_sim_time", "start_type_description_service")
"""Parameters that every ROS node has."""
LAUNCH = "launch."
"""Beginning of the names of parameters that are arguments of a launch file."""
FIXED = "fixed while the node runs"
"""Constraint of parameters that cannot be set later, in their descriptors."""


class GivenNode(Node):
    """A node that declares all given parameters, and has no QoS events.

    Every entity that an executor waits for costs time at every message. Each publisher and each
    subscription would add two events, which only report incompatible QoS. The node at the other end
    reports that, too.

    Args:
        name: the node's name.
        node_arguments: passed on to ``rclpy.node.Node`` (context, parameter_overrides, ...).

    Raises:
        ConfigError: a parameter without a value or type, such as an empty list; names it.
    """

    def __init__(self, name: str, **node_arguments: Any) -> None:
        try:
            super().__init__(
                name, automatically_declare_parameters_from_overrides=True, **node_arguments
            )
        except (ValueError, TypeError) as error:
            given = getattr(self, "_parameter_overrides", {})
            empty = [key for key, value in given.items() if value.value is None]
            if not empty:
                raise ConfigError(f"parameters: {' '.join(str(error).split())}") from error
            raise ConfigError(
                f"{', '.join(empty)}: an empty list, expected at least one value, or the "
                "parameter left out"
            ) from error

    def create_publisher(self, *arguments: Any, **named: Any) -> Any:
        """As `rclpy.node.Node.create_publisher`, without events unless they are requested."""
        named.setdefault("event_callbacks", PublisherEventCallbacks(use_default_callbacks=False))
        return super().create_publisher(*arguments, **named)

    def create_subscription(self, *arguments: Any, **named: Any) -> Any:
        """As `rclpy.node.Node.create_subscription`, without events unless they are requested."""
        named.setdefault("event_callbacks", SubscriptionEventCallbacks(use_default_callbacks=False))
        return super().create_subscription(*arguments, **named)


def given_parameters(node: Node) -> dict[str, Any]:
    """The parameters given to a node that declares them from overrides, by name; see `launched`."""
    return launched(_declared(node))


def launched(given: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters by name, with the arguments of a launch file in their places.

    A launch file cannot leave out a parameter whose argument is empty, and an empty value would
    replace that of a file of parameters. So it gives arguments as parameters `launch.NAME`, which
    replace those called NAME unless they are empty.
    """
    own = {name: value for name, value in given.items() if not name.startswith(LAUNCH)}
    arguments = {
        name.removeprefix(LAUNCH): value for name, value in given.items() if name.startswith(LAUNCH)
    }
    return own | present(arguments)


def _declared(node: Node) -> dict[str, Any]:
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
    *,
    live: Collection[str] = (),
) -> None:
    """Declare the parameters in effect with descriptors, instead of the given ones.

    Args:
        node: the node.
        values: value of every parameter; None = no value.
        lines: a one-line description of each.
        settings: the settings with ranges and choices, for the descriptors.
        live: names of parameters that may be set; the others are read-only.
    """
    held = {setting.name: setting for setting in settings}
    for name in _declared(node):
        node.undeclare_parameter(name)
    for name, value in values.items():
        descriptor = ParameterDescriptor(
            description=lines.get(name, ""),
            read_only=name not in live,
            dynamic_typing=value is None,
            additional_constraints="" if name in live else FIXED,
        )
        if name in held and value is not None:
            _hold(descriptor, held[name])
        node.declare_parameter(name, value, descriptor, ignore_override=True)


def check_names(given: Iterable[str], known: Sequence[str], node: str) -> None:
    """Check that all given names are parameters, since rclpy ignores unknown ones.

    Args:
        given: the names.
        known: all names.
        node: the executable, whose `--help` lists them.

    Raises:
        ConfigError: a name is unknown; names the most similar parameters.
    """
    for name in given:
        if name not in known:
            listed = f"`{node} --help` lists all {len(known)}"
            near = similar(name, known)
            hint = f"did you mean {' or '.join(map(repr, near))}? {listed}" if near else listed
            raise ConfigError(f"parameter {name!r} is unknown, {hint}")


def check_topics(parameter: str, topic: str, cameras: Iterable[str]) -> None:
    """Check the topics of cameras; NAME in `topic` stands for a camera.

    Raises:
        ConfigError: ROS refuses the name of a topic; names the parameter.
    """
    for camera in cameras:
        try:
            validate_topic_name(topic.replace("NAME", camera))
        except InvalidTopicNameException as error:
            reason = str(error).splitlines()[0].removeprefix("Invalid topic name: ").rstrip(":")
            raise ConfigError(
                f"{parameter}: {topic!r} of camera {camera!r} cannot be a topic: {reason}"
            ) from error


def present(given: Mapping[str, Any]) -> dict[str, Any]:
    """The values that are neither None nor an empty text."""
    return {name: value for name, value in given.items() if value is not None and value != ""}


def attribute_lines(owner: type) -> dict[str, str]:
    """Descriptions of attributes by name, from a class' docstring (``name: text``, indented)."""
    attributes = cleandoc(owner.__doc__ or "").partition("Attributes:\n")[2]
    found: dict[str, str] = {}
    for line in dedent(attributes).splitlines():
        name, colon, text = line.partition(": ")
        if colon and name.isidentifier():
            found[name] = text
        elif line.startswith(" "):
            last = next(reversed(found))
            found[last] += f" {line.strip()}"
        else:
            break
    return {name: text.removesuffix(".") for name, text in found.items()}


def _hold(descriptor: ParameterDescriptor, setting: Setting) -> None:
    """Put a setting's range and choices into its parameter's descriptor."""
    if setting.choices:
        choices = f"one of {', '.join(setting.choices)}"
        fixed = descriptor.additional_constraints
        descriptor.additional_constraints = f"{choices}; {fixed}" if fixed else choices
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
    """The value, checked to be a text.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if not isinstance(value, str):
        raise ConfigError(f"{name}: got {value!r}, expected a text")
    return value


def choice(name: str, value: Any, choices: Sequence[str]) -> str:
    """The value, checked to be one of a few texts.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if value not in choices:
        raise ConfigError(f"{name}: got {value!r}, expected one of {', '.join(choices)}")
    return str(value)


def flag(name: str, value: Any) -> bool:
    """The value, checked to be true or false.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if not isinstance(value, bool):
        raise ConfigError(f"{name}: got {value!r}, expected true or false")
    return value


def names(name: str, value: Any) -> tuple[str, ...]:
    """The value, checked to be a list of distinct names; a single name is a list of one.

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
    """The value, checked to be a whole number in a range.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ConfigError(f"{name}: got {value!r}, expected a whole number from {least} to {most}")
    return value


def numbers(name: str, value: Any, least: float, most: float) -> tuple[float, ...]:
    """The value, checked to be a list of numbers in a range.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, array)):
        raise ConfigError(f"{name}: got {value!r}, expected a list of numbers")
    return tuple(number(name, entry, least, most) for entry in value)


def number(name: str, value: Any, least: float, most: float) -> float:
    """The value, checked to be a number in a range.

    Raises:
        ConfigError: it is not; names the parameter.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
        raise ConfigError(f"{name}: got {value!r}, expected a number from {least:g} to {most:g}")
    return float(value)
