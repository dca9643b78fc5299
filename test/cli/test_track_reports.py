"""What `track` reports: warnings of frames, no person found, and how often it reads a bag."""

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from markerless_tracker.bags import write_bag
from markerless_tracker.cli import track
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import new_recording, open_recording, read_trc, write_image
from markerless_tracker.datasets.bag.stream import McapFiles, RawMessage
from markerless_tracker.results.run import TrackedFrame, track_recording
from markerless_tracker.synthesis import SyntheticScene

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(search, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """`run(source, *words)`: status, standard output, standard error; writes `out.*`."""
    config = tmp_path / "settings.yaml"
    quick = {**search, "evaluations": 200, "refinement": "none", "fit_shape": False}
    config.write_text(yaml.safe_dump(quick), encoding="utf-8")

    def call(source: Path, *words: object) -> tuple[int, str, str]:
        given = ["track", source, "-o", tmp_path / "out", "--config", config, *words]
        return main([str(word) for word in given]), *capsys.readouterr()

    return call


@pytest.fixture
def warned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every frame from the third on has two warnings, one of which holds a number."""

    def frames(*args, **kwargs) -> Iterator[TrackedFrame]:
        for tracked in track_recording(*args, **kwargs):
            number = tracked.images.index
            texts = (f"cam02: {number} px left out", "turned round") if number > 1 else ()
            yield replace(tracked, result=replace(tracked.result, warnings=texts))

    monkeypatch.setattr(track, "track_recording", frames)


def test_each_kind_of_warning_is_printed_once_with_its_first_frame(run: Run, warned, walk) -> None:
    status, out, err = run(walk, "--start", walk / "ground_truth.trc")
    assert status == 0 and "warning: " not in out
    assert [line for line in err.splitlines() if line.startswith("warning: ")] == [
        "warning: frame 2: cam02: 2 px left out",
        "warning: frame 2: turned round",
    ]
    assert "warnings in 4 frames: 2 kinds" in out.splitlines()


def test_json_has_the_warnings_of_frames(run: Run, warned, walk) -> None:
    _, out, err = run(walk, "--start", walk / "ground_truth.trc", "--json")
    assert "warning: 4 of 6 frames have warnings, of 2 kinds" in err.splitlines()
    assert json.loads(out)["frame_warnings"] == [
        {"text": "cam02: 2 px left out", "first_frame": 2, "frames": 4},
        {"text": "turned round", "first_frame": 2, "frames": 4},
    ]


def test_the_verdict_follows_the_counts(run: Run, warned, walk, tmp_path) -> None:
    _, out, _ = run(walk, "--start", walk / "ground_truth.trc")
    lines = out.splitlines()
    assert lines[0].startswith(f"{tmp_path / 'out.trc'}: 6 frames, 6 tracked, 0 lost, 0 searching")
    assert lines[1].startswith("overlap of body and silhouettes: cam01 0.")
    assert lines[2].startswith("stature of the body 1.7") and lines[-1].startswith("next: ")
    assert "warnings in 4 frames: 2 kinds" in lines
    _, out, _ = run(walk, "--start", walk / "ground_truth.trc", "--json", "--force")
    verdict = json.loads(out)["verdict"]
    assert verdict == json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["verdict"]
    assert verdict["tracked"] == 6 and verdict["frames_with_warnings"] == 4


def test_an_interrupted_run_keeps_its_frames_and_says_so(
    run: Run, walk, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def frames(*args, **kwargs) -> Iterator[TrackedFrame]:
        for tracked in track_recording(*args, **kwargs):
            if tracked.images.index == 3:
                raise KeyboardInterrupt
            yield tracked

    monkeypatch.setattr(track, "track_recording", frames)
    status, out, err = run(walk, "--start", walk / "ground_truth.trc")
    said = "interrupted after 3 frames: the rest is missing"
    assert (status, out) == (130, "") and f"warning: {said}" in err.splitlines()
    stored = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert len(stored["frames"]) == 3 and stored["verdict"]["doubts"][0] == said
    assert len(read_trc(tmp_path / "out.trc").stamps_ns) == 3


@pytest.fixture
def empty_room(tmp_path: Path) -> Path:
    """Five frames of the synthetic room without a person."""
    scene = SyntheticScene(
        body="balan31", motion="walk", size_px=(192, 144), fps=30.0, seed=4, noise=2.0
    )
    images = scene.backgrounds(10)
    with new_recording(tmp_path / "room", scene.rig, scene.fps, lossless=True) as recording:
        for name in scene.rig.names:
            recording.write_background(name, images[name][:5])
        for index in range(5, 10):
            recording.write({name: images[name][index] for name in scene.rig.names})
    return tmp_path / "room"


@pytest.mark.parametrize("json_flag", [(), ("--json",)])
def test_nobody_found_is_no_success(run: Run, empty_room, tmp_path, json_flag) -> None:
    status, out, err = run(empty_room, *json_flag)
    assert status == 3
    assert "no person was found in 5 of 5 frames; no subject file was written" in err
    if json_flag:
        assert json.loads(out)["tracked"] == 0
    else:
        assert "out.trc: 5 frames, 0 tracked, 0 lost" in out
        assert "likely cause: no silhouette in any camera: nobody is there" in out
    verdict = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["verdict"]
    assert (verdict["tracked"], verdict["searching"]) == (0, 5) and len(verdict["causes"]) == 1
    assert not (tmp_path / "out.subject.yaml").exists()
    assert not read_trc(tmp_path / "out.trc").tracked.any()


@pytest.mark.parametrize("every", [1, 3])
def test_a_bag_is_read_as_often_for_few_frames_as_for_many(
    run: Run, walk, tmp_path, monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    write_bag(open_recording(walk), tmp_path / "bag")
    passes = []
    originals = {name: getattr(McapFiles, name) for name in ("messages", "heads")}

    def counted(name: str) -> Callable[..., Iterator[RawMessage]]:
        def read(self: McapFiles, *args) -> Iterator[RawMessage]:
            passes.append(name)
            return originals[name](self, *args)

        return read

    for name in originals:
        monkeypatch.setattr(McapFiles, name, counted(name))
    words = ("--start", walk / "ground_truth.trc", "--fps", 30 // every)
    assert run(tmp_path / "bag", *words)[0] == 0
    # Once to open, once each for the start and the number of frames, and once to track.
    assert passes == ["heads", "heads", "heads", "messages"]


def test_numbered_images_give_the_result_of_the_video(run: Run, walk, tmp_path) -> None:
    status, _, _ = run(walk, "--start", walk / "ground_truth.trc")
    assert status == 0
    of_video = (tmp_path / "out.trc").read_bytes()
    folder = tmp_path / "walk"
    shutil.copytree(walk, folder)
    for frame in open_recording(walk).frames():
        for name, image in frame.images.items():
            write_image(folder / name / f"{frame.index}.png", image)
            (folder / f"{name}.mkv").unlink(missing_ok=True)
    status, _, err = run(folder, "--start", folder / "ground_truth.trc", "--force")
    assert status == 1 and "cam01 states no rate, expected --input-fps" in err
    words = ["--input-fps", 30, "--format", "folder", "--force"]
    status, _, _ = run(folder, "--start", folder / "ground_truth.trc", *words)
    assert status == 0 and (tmp_path / "out.trc").read_bytes() == of_video
