import threading
import time
from collections.abc import Iterator

import pytest

from markerless_tracker.errors import DatasetError
from markerless_tracker.node.player.prefetch import prefetch


def threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "read-prefetch"]


def test_all_items_come_in_order() -> None:
    with prefetch(lambda: iter(range(50)), 3) as items:
        assert list(items) == list(range(50))
    assert not threads()


def test_no_more_than_the_depth_is_read_ahead_and_leaving_ends_the_thread() -> None:
    made = []

    def source() -> Iterator[int]:
        for i in range(1000):
            made.append(i)
            yield i

    with prefetch(source, 4) as items:
        assert next(items) == 0
        end = time.monotonic() + 20
        while len(made) < 6 and time.monotonic() < end:
            time.sleep(0.005)
        time.sleep(0.05)
        assert len(made) == 6  # one taken, four queued, one in hand
    assert not threads()


def test_an_error_of_the_source_reaches_the_reader_after_what_came_before() -> None:
    def source() -> Iterator[int]:
        yield 1
        raise DatasetError("bag: cut off")

    got = []
    with prefetch(source, 4) as items, pytest.raises(DatasetError, match="cut off"):
        for item in items:
            got.append(item)
    assert got == [1]
