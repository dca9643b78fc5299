"""Settings as dataclass fields with their documentation, range and choices; groups of settings."""

from collections.abc import Iterable, Mapping
from dataclasses import Field, dataclass, field, fields
from difflib import SequenceMatcher, get_close_matches
from typing import Any, ClassVar, Self

from markerless_tracker.errors import ConfigError

# Whole numbers up to here are floats without loss; no setting needs larger ones.
_EXACT = 2**53
_AS_NEAR = 0.1
_LIKE = 0.8
_LEAST_BEGINNING = 3
MOST_SIMILAR = 3
"""Names that the message about an unknown one suggests."""


@dataclass(frozen=True)
class Setting:
    """One setting as users meet it: key of `--config`, and parameter of the node.

    Attributes:
        name: `name`, or `group.name` for a setting in a group.
        type: str, int, float or bool.
        default: the value unless given.
        doc: one line about it.
        choices: the texts it may be; None for any.
        min: its least value; None for texts and flags.
        max: its largest value; None for texts and flags.
    """

    name: str
    type: type
    default: Any
    doc: str
    choices: tuple[str, ...] | None
    min: float | None
    max: float | None


def setting(
    default: Any,
    doc: str,
    *,
    least: float | None = None,
    most: float | None = None,
    choices: tuple[str, ...] | None = None,
) -> Any:
    """A dataclass field with its documentation and the range or choices it is held to."""
    metadata = {"doc": doc, "min": least, "max": most, "choices": choices}
    return field(default=default, metadata={k: v for k, v in metadata.items() if v is not None})


def group(kind: "type[SettingsGroup]") -> Any:
    """A dataclass field that holds a group of settings, with the group's defaults."""
    return field(default_factory=kind, metadata={"group": kind})


@dataclass(frozen=True, kw_only=True)
class SettingsGroup:
    """Base of frozen dataclasses of settings; they check themselves.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """

    NAME: ClassVar[str]
    """Name of the group, for messages."""

    def __post_init__(self) -> None:
        check_settings(self, f"{self.NAME}.")


@dataclass(frozen=True, kw_only=True)
class GroupedSettings:
    """Base of frozen dataclasses of settings at the top and in groups, one level deep.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """

    def __post_init__(self) -> None:
        check_settings(self)

    @classmethod
    def settings(cls) -> tuple[Setting, ...]:
        """All settings: those at the top, then those of each group, in order."""
        found = [_described(entry, "") for entry in fields(cls) if "group" not in entry.metadata]
        for entry in fields(cls):
            if "group" in entry.metadata:
                members = fields(entry.metadata["group"])
                found += [_described(member, f"{entry.name}.") for member in members]
        return tuple(found)

    @classmethod
    def dotted(cls, values: Mapping[Any, Any]) -> dict[str, Any]:
        """Values by dotted name, of a mapping whose groups are nested or dotted.

        Raises:
            ConfigError: an unknown key, naming the nearest known one, or a key given twice.
        """
        known = {entry.name for entry in cls.settings()}
        groups = {entry.name for entry in fields(cls) if "group" in entry.metadata}
        found: dict[str, Any] = {}
        for key, value in values.items():
            if isinstance(key, str) and key in groups:
                if not isinstance(value, Mapping):
                    raise ConfigError(f"{key}: got {value!r}, expected a group of settings")
                items = [(f"{key}.{member}", own) for member, own in value.items()]
            else:
                items = [(key, value)]
            for name, own in items:
                if name not in known:
                    raise ConfigError(f"unknown setting {name!r}{nearest(str(name), known)}")
                if name in found:
                    raise ConfigError(f"{name}: given twice, nested and dotted")
                found[name] = own
        return found

    @classmethod
    def from_mapping(cls, values: Mapping[Any, Any]) -> Self:
        """Settings from the values given, nested or dotted.

        Raises:
            ConfigError: an unknown key, naming the nearest known one, or an impossible value.
        """
        return cls(**_members(cls, cls.dotted(values)))

    def by_name(self) -> dict[str, Any]:
        """All settings by dotted name."""
        found = {}
        for entry in self.settings():
            owner, _, name = entry.name.rpartition(".")
            found[entry.name] = getattr(getattr(self, owner) if owner else self, name)
        return found

    def as_mapping(self) -> dict[str, Any]:
        """All settings, groups nested, as `from_mapping` takes them."""
        nested: dict[str, Any] = {}
        for name, value in self.by_name().items():
            owner, _, member = name.rpartition(".")
            (nested.setdefault(owner, {}) if owner else nested)[member] = value
        return nested


def check_settings(record: Any, prefix: str = "") -> None:
    """Check every field of a frozen dataclass of settings; whole numbers pass as floats.

    Args:
        record: the dataclass.
        prefix: of the fields' names in messages.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """
    for entry in fields(record):
        value = _checked(entry, f"{prefix}{entry.name}", getattr(record, entry.name))
        object.__setattr__(record, entry.name, value)


def nearest(name: str, known: Iterable[str]) -> str:
    """', did you mean ...?' if a known name is near enough, else nothing.

    A name without its group is near the name in its group.
    """
    close = similar(name, known)
    return f", did you mean {' or '.join(map(repr, close))}?" if close else ""


def similar(name: str, known: Iterable[str]) -> list[str]:
    """The known names that are near enough, the nearest first, at most `MOST_SIMILAR`.

    A name without its group is near the names in groups, the beginning of a name near the whole.
    Names much farther than the nearest are left out.
    """
    named = sorted(known)
    inside = [full for full in named if full.rpartition(".")[2] == name]
    if inside:
        return inside[:MOST_SIMILAR]
    likeness = {one: SequenceMatcher(None, one, name).ratio() for one in named}
    near = get_close_matches(name, named, n=MOST_SIMILAR)
    begun = [one for one in named if one.startswith(name) and len(name) >= _LEAST_BEGINNING]
    if begun and (not near or likeness[near[0]] < _LIKE):
        near = sorted(begun, key=lambda one: -likeness[one])[:MOST_SIMILAR]
    return [one for one in near if likeness[one] > likeness[near[0]] - _AS_NEAR]


def _described(entry: "Field[Any]", prefix: str) -> Setting:
    about = entry.metadata
    return Setting(
        f"{prefix}{entry.name}", type(entry.default), entry.default, about["doc"],
        about.get("choices"), about.get("min"), about.get("max"),
    )  # fmt: skip


def _members(cls: type[GroupedSettings], values: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the class: values by dotted name, those of a group as that group."""
    arguments = {name: value for name, value in values.items() if "." not in name}
    for entry in fields(cls):
        if "group" in entry.metadata:
            prefix = f"{entry.name}."
            own = {n.removeprefix(prefix): v for n, v in values.items() if n.startswith(prefix)}
            arguments[entry.name] = entry.metadata["group"](**own)
    return arguments


def _checked(entry: Any, name: str, value: Any) -> Any:
    kind = entry.metadata.get("group") or type(entry.default)
    if kind is float and type(value) is int and abs(value) <= _EXACT:
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(f"{name}: got {value!r}, expected {kind.__name__}")
    least, most = entry.metadata.get("min"), entry.metadata.get("max")
    if least is not None and not least <= value <= most:
        raise ConfigError(f"{name}: got {value!r}, expected {least} to {most}")
    choices = entry.metadata.get("choices")
    if choices is not None and value not in choices:
        raise ConfigError(f"{name}: got {value!r}, expected one of {', '.join(choices)}")
    return value
