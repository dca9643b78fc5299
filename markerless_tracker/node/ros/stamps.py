"""Conversion between integer nanoseconds and builtin_interfaces/Time."""

from typing import Any

from builtin_interfaces.msg import Time

_SECOND_NS = 1_000_000_000


def stamp_of(message: Any) -> int:
    """The stamp of a message with a header, in ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * _SECOND_NS + int(stamp.nanosec)


def time_message(stamp_ns: int) -> Time:
    """builtin_interfaces/Time of a stamp in ns."""
    seconds, nanoseconds = divmod(int(stamp_ns), _SECOND_NS)
    return Time(sec=seconds, nanosec=nanoseconds)
