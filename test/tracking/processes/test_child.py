"""A child process with pipes of the usual size."""

import subprocess
from typing import Any

import pytest

from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking.evidence.segmenting import SegmentingProcess


def test_it_starts_where_pipes_cannot_be_enlarged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user who has many pipes may not: fcntl is refused then."""
    asked: list[int] = []

    class Limited(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *words: Any, pipesize: int = -1, **options: Any) -> None:
            asked.append(pipesize)
            if pipesize > 0:
                raise PermissionError(1, "Operation not permitted")
            super().__init__(*words, pipesize=pipesize, **options)

    monkeypatch.setattr(subprocess, "Popen", Limited)
    process = SegmentingProcess(ring_rig(3, (160, 120)))
    assert len(asked) == 2 and process.pid > 0
    process.close()
    assert process.take_fault() is None
