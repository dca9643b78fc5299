"""The verb `compile`: afterwards a tracker compiles nothing, and neither does the verb again."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import markerless_tracker.cli.compile as compile_verb
from markerless_tracker.cli.main import main
from markerless_tracker.tracking import Tracker, TrackerConfig
from markerless_tracker.tracking.config import OPTIMIZERS

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys
from markerless_tracker.cli.compile import warm_up
from markerless_tracker.compiled import compilation
from markerless_tracker.tracking import TrackerConfig
with compilation(lambda *_: None) as counted:
    warm_up(TrackerConfig(), 3)
print(counted.done)
"""


def test_what_is_stored_is_not_compiled_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "--optimizer", "sppso", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["optimizers"] == ["sppso"] and first["compiled"] >= 0
    assert main(["compile", "--optimizer", "sppso"]) == 0
    assert capsys.readouterr().out.startswith("0 kernels compiled in ")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.stdout.strip() == "0", done.stderr


TRACKS = """
import pickle, sys
from markerless_tracker import compiled
from markerless_tracker.calibration.contours.time_offset import TimeOffsetEstimate
from markerless_tracker.imaging import learn_background
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import Tracker, TrackerConfig

def kernels():
    return {(d.py_func.__name__, str(s)) for d in compiled._dispatchers for s in d.overloads}

scene = SyntheticScene(size_px=(328, 245), fps=30.0, samples=2, motion="walk")
backgrounds = {name: learn_background(images) for name, images in scene.backgrounds(8).items()}
start = scene.pose(0) if sys.argv[2:] == ["given"] else None
tracker = Tracker(
    scene.rig, scene.body, TrackerConfig(), start_pose=start, backgrounds=backgrounds
)
offsets = TimeOffsetEstimate(scene.rig, step_px=2.0)
frames = [scene.frame(index)[0] for index in range(24)]
tracker.warm_up()
offsets.warm_up(tracker.body)
before = kernels()
used, results = 0, []
for index, images in enumerate(frames):
    result = tracker.step(images, scene.stamp_ns(index))
    results.append((result, tracker.body))
    offsets.add(*results[-1])
    used += offsets._frames
print(sorted(kernels() - before), used > 0, len(before) > 0)
with open(sys.argv[1], "wb") as file:
    pickle.dump((scene.rig, results), file)
"""


OFFSETS = """
import pickle, sys
from markerless_tracker import compiled
from markerless_tracker.calibration.contours.time_offset import TimeOffsetEstimate

def kernels():
    return {(d.py_func.__name__, str(s)) for d in compiled._dispatchers for s in d.overloads}

with open(sys.argv[1], "rb") as file:
    rig, results = pickle.load(file)
offsets = TimeOffsetEstimate(rig, step_px=2.0)
offsets.warm_up(results[0][1])
before = kernels()
used = 0
for result, body in results:
    offsets.add(result, body)
    used += offsets._frames
print(sorted(kernels() - before), used > 0, len(before) > 0)
"""


def test_no_kernel_is_compiled_or_loaded_while_a_person_is_tracked(tmp_path: Path) -> None:
    """Each would hold up a set of a live stream, by half a second where it is compiled.

    In the node the time offsets have another process than the tracker, and load their own kernels.
    """
    for program, *start in ((TRACKS, "given"), (TRACKS,), (OFFSETS,)):
        done = subprocess.run(
            [sys.executable, "-c", program, str(tmp_path / "results"), *start],
            capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        assert done.stdout.strip() == "[] True True", done.stdout + done.stderr


def test_every_optimizer_is_compiled_with_its_own_budget(monkeypatch) -> None:
    plans = []
    monkeypatch.setattr(compile_verb, "warm_up", lambda config, channels: plans.append(config))
    assert main(["compile"]) == 0
    assert [plan.optimizer for plan in plans[::2]] == list(OPTIMIZERS)
    for plan in plans:
        assert (
            plan.evaluations
            == TrackerConfig.from_mapping({"optimizer": plan.optimizer}).evaluations
        )


def test_an_unknown_optimizer_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["compile", "--optimizer", "sppso,annealing"])
    assert ended.value.code == 2 and "'annealing'" in capsys.readouterr().err


def test_an_interruption_ends_the_segmenting_process(monkeypatch: pytest.MonkeyPatch) -> None:
    pids: list[int] = []

    def interrupted(self: Tracker) -> None:
        pids.append(self.evidence._process.pid)
        raise KeyboardInterrupt

    monkeypatch.setattr(Tracker, "warm_up", interrupted)
    with pytest.raises(KeyboardInterrupt):
        compile_verb.warm_up(TrackerConfig(), 3)
    (pid,) = pids
    assert not Path(f"/proc/{pid}").exists()
