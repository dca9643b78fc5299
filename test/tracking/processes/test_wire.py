"""Messages between processes, from several threads at once."""

import os
from concurrent.futures import ThreadPoolExecutor

import pytest

from markerless_tracker.tracking.processes.wire import receive, send


def test_messages_of_several_threads_arrive_whole() -> None:
    read_fd, write_fd = os.pipe()
    count, size = 50, 20_000
    with os.fdopen(read_fd, "rb") as reader, os.fdopen(write_fd, "wb") as writer:
        with ThreadPoolExecutor(4) as pool:
            sent = [pool.submit(send, writer, (number, b"x" * size)) for number in range(count)]
            received = [receive(reader) for _ in sent]
        assert sorted(number for number, _ in received) == list(range(count))
        assert {len(data) for _, data in received} == {size}


def test_an_end_within_a_message_is_an_error() -> None:
    read_fd, write_fd = os.pipe()
    with os.fdopen(read_fd, "rb") as reader:
        with os.fdopen(write_fd, "wb") as writer:
            writer.write(b"\x05\0\0\0\0\0\0\0ab")
        with pytest.raises(EOFError, match="has ended"):
            receive(reader)
