"""Sizes that can be saved are those of a person whose start is complete."""

from collections.abc import Callable
from typing import Any

import pytest

Trigger = pytest.importorskip("std_srvs.srv", reason="ROS 2 is not installed").Trigger


def test_sizes_are_not_saved_while_the_start_tries_bodies(
    begin: Callable[..., Any], tmp_path: Any
) -> None:
    live = begin(start_file=None, subject_file=None, stature=1.72, save_dir=tmp_path)
    live.track()
    client = live.peer.node.create_client(Trigger, "tracker/save_subject")
    live.until(client.service_is_ready, "the service")
    future = client.call_async(Trigger.Request())
    live.until(future.done, "the answer")
    assert live.value("state") == "TRACKING"
    answer = future.result()
    assert (answer.success, answer.message) == (False, "nobody was tracked, so no sizes are known")
