"""Generated scenes from the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import load_body, markers, read_pose, read_subject
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.synthesis.scenes import GeneratedScene


def test_a_generated_recording_has_exact_truth(tmp_path: Path, capsys) -> None:
    out = tmp_path / "scene"
    words = ["--scene", "1003", "--seconds", "0.05", "--fps", "40", "--lossless", "--json"]
    assert main(["synthesize", str(out), *words]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["seed"] == 1003 and said["frames"] == 2 and said["motion"] == "walk"

    scene = GeneratedScene(1003, fps=40.0)
    recording = open_recording(out)
    assert recording.fps == 40.0 and recording.warnings == ()
    images, masks, _ = scene.frame(0)
    first = next(iter(recording.frames()))
    for camera in recording.rig:
        np.testing.assert_array_equal(first.images[camera.name], images[camera.name])
        np.testing.assert_array_equal(recording.masks(camera.name)[0] > 0, masks[camera.name])
    truth = read_trc(out / "ground_truth.trc")
    np.testing.assert_allclose(truth.positions_m[1], scene.markers(1), atol=1e-5)
    assert json.loads((out / "scene.json").read_text())["seed"] == 1003
    body = load_body("person31", read_subject(out / "subject.yaml"))
    start = read_pose(out / "start.yaml", body)
    assert np.linalg.norm(markers(body, start) - truth.positions_m[0], axis=1).max() < 0.03


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["synthesize", "OUT", "--scene", "1", "--noise", "5"], "expected no --noise"),
        (["synthesize", "OUT", "--scene", "-1"], "seed of a scene is -1"),
        (["synthesize", "OUT", "--motion", "squat"], "motion is 'squat'"),
        (["benchmark", "silhouettes", "OUT", "--generated", "test"], "expected no SOURCE"),
        (["benchmark", "silhouettes", "--scenes", "3"], "--generated"),
    ],
)
def test_words_that_do_not_go_together(words, message, tmp_path: Path, capsys) -> None:
    assert main([str(tmp_path / "out") if word == "OUT" else word for word in words]) == 1
    assert message in capsys.readouterr().err
