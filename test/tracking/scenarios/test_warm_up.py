"""After `warm_up` no step waits for a kernel: none is compiled, or loaded, for other arguments.

Images may be read-only, as those of messages and of shared memory are, and have padded rows.
"""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from pathlib import Path

import numpy as np

from markerless_tracker.compiled import _dispatchers
from markerless_tracker.imaging import learn_background
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.body import load_body

scene = SyntheticScene(body="person32", motion="walk", size_px=(256, 192), seed=4, noise=2.0)
config = TrackerConfig.from_mapping({"threads": 1})
backgrounds = {n: learn_background(f, config) for n, f in scene.backgrounds(6).items()}
images = {number: scene.frame(number)[0] for number in range(0, 16, 2)}
for number, views in images.items():
    for name, image in views.items():
        if number % 4 == 0:
            padded = np.zeros((image.shape[0], image.shape[1] + 5, 3), np.uint8)
            padded[:, :-5] = image
            views[name] = padded[:, :-5]
        views[name].flags.writeable = number > 10
given = sys.argv[1] == "given"
tracker = Tracker(
    scene.rig, scene.body, config, backgrounds=backgrounds,
    start_pose=scene.frame(0)[2] if given else None,
)
tracker.warm_up()


def known():
    return {(d.py_func.__name__, s) for d in _dispatchers for s in d.signatures}


before = known()
for number, views in images.items():
    stamp_ns = scene.stamp_ns(number)
    result = tracker.step(tracker.prepare(views, stamp_ns), stamp_ns)
assert result.state.value == "TRACKING", result.state
for late in known() - before:
    print(*late)
"""


@pytest.mark.parametrize("start", ["given", "found"])
def test_every_kernel_is_there_after_the_warm_up(start) -> None:
    # A process of its own: other tests use kernels, too.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, start],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
