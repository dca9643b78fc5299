"""The segmenting process compiles what the tracker beside it needs of the contours."""

import io
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from markerless_tracker.imaging import learn_background
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.evidence.segmenting import Ready
from markerless_tracker.tracking.evidence.segmenting_main import serve
from markerless_tracker.tracking.processes import compiling
from markerless_tracker.tracking.processes.wire import receive, send

PROGRAM = """
from markerless_tracker.compiled import _dispatchers
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig, build_tracker
from markerless_tracker.tracking.processes.compiling import compile_contours

NAMES = ("descend", "_sum_shifts", "_fill_jacobian", "_eliminate")

def signatures():
    return {d.py_func.__module__ + d.py_func.__name__: list(d.signatures)
            for d in _dispatchers if d.py_func.__name__ in NAMES}

rig, config = ring_rig(3, (160, 120)), TrackerConfig.from_mapping({"threads": 1})
setup = build_tracker(rig, config)
tracker = setup.tracker
compile_contours(rig, config, tracker.evidence.made_up())
ahead = signatures()
tracker.warm_up()
print([len(each) for each in ahead.values()], signatures() == ahead)
"""


def test_the_tracker_uses_the_same_kernels() -> None:
    # A process of its own: other tests use the kernels, too.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout == "[1, 1, 1, 1, 1] True\n", done.stderr


def test_without_refinement_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "load_body", lambda _: pytest.fail("loads a body"))
    config = TrackerConfig.from_mapping({"refinement": "none"})
    compiling.compile_contours(ring_rig(3, (160, 120)), config, {})


def test_the_process_compiles_it_before_it_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, config = ring_rig(2, (64, 48)), TrackerConfig()
    empty = [np.full((48, 64, 3), 90, np.uint8) for _ in range(3)]
    requests, answers = io.BytesIO(), io.BytesIO()
    send(requests, (rig, config, {name: learn_background(empty) for name in rig.names}))
    requests.seek(0)
    compiled = []

    def note(*given: object) -> None:
        assert answers.tell() == 0
        compiled.append(given)

    monkeypatch.setattr(compiling, "compile_contours", note)
    with pytest.raises(EOFError):
        serve(requests, answers, None)  # type: ignore[arg-type]
    answers.seek(0)
    assert isinstance(receive(answers)[0], Ready)
    ((used, settings, observations),) = compiled
    assert used.names == rig.names and settings == config
    assert sorted(observations) == sorted(rig.names)


def test_the_first_step_of_warming_up_waits_for_the_segmenting_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else both would compile the refinement."""
    tracker = build_tracker(
        ring_rig(2, (64, 48)), TrackerConfig.from_mapping({"threads": 1})
    ).tracker
    calls: list[str] = []
    for owner, name in ((tracker.evidence, "finish_compiling"), (tracker, "step")):
        real = getattr(owner, name)

        def noted(*args: Any, real: Any = real, name: str = name) -> Any:
            calls.append(name)
            return real(*args)

        monkeypatch.setattr(owner, name, noted)
    tracker.warm_up()
    assert calls == ["finish_compiling", "step"]
