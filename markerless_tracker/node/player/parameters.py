"""The player node's parameters."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from markerless_tracker.errors import ConfigError
from markerless_tracker.node.ros import declared


@dataclass(frozen=True, kw_only=True)
class PlayerSettings:
    """Parameters of the player.

    Attributes:
        bag: the bag's folder, or its `.mcap`.
        rate: 1 is the bag's own pace.
        loop: start again at the end.
        start_offset: s to skip at the beginning of the bag.
        wait_for_subscribers: wait until every image topic has a subscriber and `state` says ready.
        lockstep: send the next set when `state` tells that the last was dealt with; ignores `rate`.
        lockstep_timeout: s after which the next set is sent nevertheless.
        paused: begin paused: nothing is sent before `~/step` or `~/resume`.
        clock: messages per s on `/clock` between the sets, beside one with every set; 0 for none.
        topics: topics to play (default: images and camera infos of all cameras).
    """

    bag: Path
    rate: float = 1.0
    loop: bool = False
    start_offset: float = 0.0
    wait_for_subscribers: bool = False
    lockstep: bool = False
    lockstep_timeout: float = 60.0
    paused: bool = False
    clock: float = 0.0
    topics: tuple[str, ...] | None = None


_NAMES = tuple(entry.name for entry in fields(PlayerSettings))


def read_player_settings(given: Mapping[str, Any]) -> PlayerSettings:
    """Settings from the parameters a user gave.

    Raises:
        ConfigError: no bag, an unknown name or an impossible value; names the parameter.
    """
    declared.check_names(given, _NAMES, "player")
    values = declared.present(given)
    if "bag" not in values:
        raise ConfigError("bag: not given, expected the folder of a bag (-p bag:=FOLDER)")
    chosen: dict[str, Any] = {"bag": Path(declared.text("bag", values["bag"])).expanduser()}
    for name, least, most in (
        ("rate", 1e-3, 1e3),
        ("start_offset", 0.0, 1e9),
        ("lockstep_timeout", 0.1, 1e6),
        ("clock", 0.0, 1e3),
    ):
        if name in values:
            chosen[name] = declared.number(name, values[name], least, most)
    for name in ("loop", "wait_for_subscribers", "lockstep", "paused"):
        if name in values:
            chosen[name] = declared.flag(name, values[name])
    if "topics" in values:
        chosen["topics"] = tuple(
            f"/{name.strip('/')}" for name in declared.names("topics", values["topics"])
        )
    return PlayerSettings(**chosen)


def player_values(settings: PlayerSettings) -> dict[str, Any]:
    """Value of every parameter in a type that ROS supports."""
    topics = None if settings.topics is None else list(settings.topics)
    return {**asdict(settings), "bag": str(settings.bag), "topics": topics}


def default_values() -> dict[str, Any]:
    """Default of every parameter; `bag` has none."""
    return {entry.name: entry.default for entry in fields(PlayerSettings) if entry.name != "bag"}


def descriptions() -> dict[str, str]:
    """A one-line description of every parameter."""
    return declared.attribute_lines(PlayerSettings)
