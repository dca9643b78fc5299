"""Messages of several cameras grouped into sets of one stamp."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from markerless_tracker.datasets.bag.stream import HEAD_BYTES, Place, RawMessage
from markerless_tracker.errors import DatasetError

# Limit of incomplete sets held at a time; it bounds the memory if a camera records nothing.
MAX_PENDING = 32


class StampedSet(NamedTuple):
    """A complete set: stamp (ns), camera -> message, and the place to read it from."""

    stamp_ns: int
    messages: Mapping[str, RawMessage]
    place: Place


class SetGrouping:
    """Groups one pass over a bag into complete sets by increasing stamp.

    Each pass has its own counts: concurrent passes do not change them.

    Args:
        topics: topic -> camera, in the order of the rig.
        path: the bag, for messages.
        first_ns: images with an earlier stamp are ignored and not counted; None takes all.

    Attributes:
        incomplete: camera -> number of its images missing from sets.
        late: camera -> number of its images recorded after a later set was complete.
    """

    def __init__(self, topics: Mapping[str, str], path: Path, first_ns: int | None = None) -> None:
        self._topics, self._path, self._first_ns = topics, path, first_ns
        self.incomplete: Counter[str] = Counter()
        self.late: Counter[str] = Counter()

    def sets(self, messages: Iterable[RawMessage]) -> Iterator[StampedSet]:
        """The complete sets among messages in file order.

        Raises:
            DatasetError: an image message is too short to hold a stamp.
        """
        pending: dict[int, dict[str, RawMessage]] = {}
        done = None
        for message in messages:
            name = self._topics.get(message.topic)
            if name is None:
                continue
            stamp = _stamp(message, self._path)
            if self._first_ns is not None and stamp < self._first_ns:
                continue
            if done is not None and stamp <= done:
                self.late[name] += 1
                continue
            pending.setdefault(stamp, {})[name] = message
            if len(pending[stamp]) == len(self._topics):
                # Images of later sets may have been read already: the place is before them.
                place = min(m.place for parts in pending.values() for m in parts.values())
                complete = pending.pop(stamp)
                for earlier in [other for other in pending if other < stamp]:
                    self._drop(pending.pop(earlier))
                done = stamp
                ordered = {camera: complete[camera] for camera in self._topics.values()}
                yield StampedSet(stamp, ordered, place)
            elif len(pending) > MAX_PENDING:
                done = min(pending)
                self._drop(pending.pop(done))
        for rest in pending.values():
            self._drop(rest)

    def _drop(self, messages: Mapping[str, RawMessage]) -> None:
        self.incomplete.update(name for name in self._topics.values() if name not in messages)


def _stamp(message: RawMessage, path: Path) -> int:
    """Stamp (ns) of a message that begins with a std_msgs/Header, without decoding the rest."""
    if len(message.data) < HEAD_BYTES:
        raise DatasetError(
            f"{path}: {message.topic}: a message of {len(message.data)} bytes has no header"
        )
    # Second byte of the encapsulation: 1 = little endian.
    order: Any = "little" if message.data[1] & 1 else "big"
    seconds = int.from_bytes(message.data[4:8], order, signed=True)
    return seconds * 10**9 + int.from_bytes(message.data[8:12], order)
