"""Settings as dataclass fields that carry their documentation and the values they may take."""

from dataclasses import field, fields
from typing import Any

from markerless_tracker.errors import ConfigError

# Whole numbers up to here are floats without loss; no setting needs larger ones.
_EXACT = 2**53


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


def check_settings(record: Any) -> None:
    """Check every field of a frozen dataclass of settings; whole numbers pass as floats.

    Raises:
        ConfigError: a value of the wrong type, out of its range or not among its choices.
    """
    for entry in fields(record):
        object.__setattr__(record, entry.name, _checked(entry, getattr(record, entry.name)))


def _checked(entry: Any, value: Any) -> Any:
    kind = type(entry.default)
    if kind is float and type(value) is int and abs(value) <= _EXACT:
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(f"{entry.name}: got {value!r}, expected {kind.__name__}")
    least, most = entry.metadata.get("min"), entry.metadata.get("max")
    if least is not None and not least <= value <= most:
        raise ConfigError(f"{entry.name}: got {value!r}, expected {least} to {most}")
    choices = entry.metadata.get("choices")
    if choices is not None and value not in choices:
        raise ConfigError(f"{entry.name}: got {value!r}, expected one of {', '.join(choices)}")
    return value
