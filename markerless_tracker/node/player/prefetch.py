"""Prefetches items in a thread, so that decoding and publishing overlap."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty, Full, Queue
from threading import Event, Thread
from typing import TypeVar

Item = TypeVar("Item")

_POLL_S = 0.1


@contextmanager
def prefetch(source: Callable[[], Iterator[Item]], depth: int) -> Iterator[Iterator[Item]]:
    """Iterate in a thread; at most `depth` items wait for the caller.

    Exceptions of the iterator are raised where the items are read. Leaving the context ends the
    thread.
    """
    queue: Queue[tuple[str, Item | None, BaseException | None]] = Queue(depth)
    stop = Event()

    def put(kind: str, item: Item | None = None, error: BaseException | None = None) -> None:
        while not stop.is_set():
            try:
                queue.put((kind, item, error), timeout=_POLL_S)
                return
            except Full:
                continue

    def read() -> None:
        try:
            for item in source():
                if stop.is_set():
                    return
                put("item", item)
        except BaseException as error:
            put("error", error=error)
        else:
            put("end")

    def items() -> Iterator[Item]:
        while True:
            try:
                kind, item, error = queue.get(timeout=_POLL_S)
            except Empty:
                if not thread.is_alive() and queue.empty():
                    return
                continue
            if error is not None:
                raise error
            if kind == "end":
                return
            yield item  # type: ignore[misc]

    thread = Thread(target=read, name="read-prefetch", daemon=True)
    thread.start()
    try:
        yield items()
    finally:
        stop.set()
        thread.join()
