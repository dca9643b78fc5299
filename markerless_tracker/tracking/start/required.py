"""What the automatic start needs of a body."""

from markerless_tracker.body import BodyModel
from markerless_tracker.errors import ConfigError

_ROTATIONS = ("pelvis_rx", "pelvis_ry", "pelvis_rz")


def missing_for_start(body: BodyModel) -> list[str]:
    """What a body lacks to be placed by the automatic start; empty if nothing."""
    missing = [f"parameter {name}" for name in _ROTATIONS if name not in body.parameter_names]
    if body.hierarchies and "six" not in body.hierarchies:
        missing.append("hierarchy six")
    return missing


def require_parts_of_a_start(body: BodyModel) -> None:
    """Refuse a body that the automatic start cannot place.

    Raises:
        ConfigError: something is missing; names it.
    """
    missing = missing_for_start(body)
    if missing:
        raise ConfigError(
            f"body {body.name} has no {', no '.join(missing)}, which finding a person takes: "
            "add it, or give a start pose and set search_again to false"
        )
