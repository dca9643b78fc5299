"""The segmenting process compiles the refinement that the tracker beside it needs."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest

from markerless_tracker.imaging import learn_background
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import TrackerConfig
from markerless_tracker.tracking.evidence.segmenting import Ready
from markerless_tracker.tracking.evidence.segmenting_main import serve
from markerless_tracker.tracking.processes import compiling
from markerless_tracker.tracking.processes.wire import receive, send

PROGRAM = """
from markerless_tracker.body import load_body
from markerless_tracker.compiled import _dispatchers
from markerless_tracker.synthesis.rig import ring_rig
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.processes.compiling import compile_refinement

def refinements():
    return [s for d in _dispatchers if d.py_func.__name__ == "descend" for s in d.signatures]

rig, config = ring_rig(3, (160, 120)), TrackerConfig.from_mapping({"threads": 1})
tracker = Tracker(rig, load_body(config.body, 1.8), config)
compile_refinement(rig, config, tracker.evidence.warm_up())
ahead = refinements()
tracker.warm_up()
print(len(ahead), refinements() == ahead)
"""


def test_the_tracker_refines_with_the_same_kernels() -> None:
    # A process of its own: other tests use the kernels, too.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout == "1 True\n", done.stderr


def test_without_refinement_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "load_body", lambda _: pytest.fail("loads a body"))
    config = TrackerConfig.from_mapping({"refinement": "none"})
    compiling.compile_refinement(ring_rig(3, (160, 120)), config, {})


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

    monkeypatch.setattr(compiling, "compile_refinement", note)
    with pytest.raises(EOFError):
        serve(requests, answers, None)  # type: ignore[arg-type]
    answers.seek(0)
    assert isinstance(receive(answers)[0], Ready)
    ((used, settings, observations),) = compiled
    assert used.names == rig.names and settings == config
    assert sorted(observations) == sorted(rig.names)
