"""The verb `synthesize`, as a user calls it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.body import (
    MARKER_NAMES,
    Feasibility,
    load_body,
    markers,
    read_pose,
    read_subject,
)
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.drawing import silhouette

SMALL = ["--seconds", "0.1", "--size", "164x122"]


def test_the_recording_is_complete_and_consistent(tmp_path: Path, capsys) -> None:
    out = tmp_path / "made" / "up"
    words = [
        "--motion",
        "balance",
        "--cameras",
        "3",
        "--stature",
        "1.8",
        "--lossless",
        "--seed",
        "4",
    ]
    assert main(["synthesize", str(out), *SMALL, *words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["frames"] == 6 and summary["cameras"] == ["cam01", "cam02", "cam03"]
    assert summary["motion"] == "balance" and summary["seed"] == 4 and summary["fps"] == 60.0

    recording = open_recording(out)
    assert recording.fps == 60.0 and recording.frame_count == 6 and recording.warnings == ()
    sets = list(recording.frames())
    empty = recording.background_frames()
    assert set(empty) == set(recording.rig.names) and all(len(e) >= 5 for e in empty.values())

    body = load_body("balan31", read_subject(out / "subject.yaml"))
    np.testing.assert_allclose(body.cone_length, load_body("balan31", 1.8).cone_length)
    start = read_pose(out / "start.yaml", body)
    assert Feasibility(body, body.limits, "elliptic")(start[None]).all()
    truth = read_trc(out / "ground_truth.trc")
    assert truth.names == MARKER_NAMES
    np.testing.assert_array_equal(truth.stamps_ns, [s.stamp_ns for s in sets])
    np.testing.assert_allclose(truth.positions_m[0], markers(body, start), atol=1e-6)
    assert np.abs(np.diff(truth.positions_m, axis=0)).max() > 1e-4

    for camera in recording.rig:
        mask = recording.masks(camera.name)[0] > 0
        expected = silhouette(body, start, camera, samples=3)
        assert (mask & expected).sum() > 0.98 * (mask | expected).sum()
        changed = np.abs(sets[0].images[camera.name].astype(int) - empty[camera.name][0]).max(
            axis=2
        )
        assert np.median(changed[mask]) > 40 and np.median(changed[~mask]) < 10


def test_the_same_arguments_give_the_same_bytes(tmp_path: Path, capsys) -> None:
    for name in ("one", "two"):
        assert main(["synthesize", str(tmp_path / name), *SMALL, "--lossless"]) == 0
    files = [p.relative_to(tmp_path / "one") for p in (tmp_path / "one").rglob("*") if p.is_file()]
    assert len(files) > 20
    for file in files:
        if file.suffix != ".mkv":  # containers carry a random identifier
            assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    pairs = zip(*(open_recording(tmp_path / n).frames() for n in ("one", "two")), strict=True)
    for a, b in pairs:
        for camera in a.images:
            np.testing.assert_array_equal(a.images[camera], b.images[camera])


def test_videos_are_lossless_only_on_request(tmp_path: Path, capsys) -> None:
    assert main(["synthesize", str(tmp_path / "a"), *SMALL]) == 0
    assert sorted(p.name for p in (tmp_path / "a").glob("cam*")) == [
        f"cam0{i}.mp4" for i in (1, 2, 3, 4)
    ]
    summary = capsys.readouterr()
    assert summary.out == f"{tmp_path / 'a'}: 6 frames of 4 cameras, with exact truth\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--size", "big"], "--size is 'big', expected WxH"),
        (["--size", "65x49"], "cam01: .*65x49 .* even numbers"),
        (["--size", "8x8"], "image width is 8, expected 16 to 8192"),
        (["--seconds", "0"], "0 s at 60 fps, expected 1 to"),
        (["--seconds", "nan"], "nan s at 60 fps"),
        (["--seconds", "1e9"], "1e\\+09 s at 60 fps"),
        (["--fps", "-1"], "4 s at -1 fps"),
        (["--cameras", "0"], "--cameras is 0, expected 2 to 99"),
        (["--cameras", "1"], "--cameras is 1, expected 2 to 99: one camera does not see how far"),
        (["--size", "8x8", "--checkerboard"], "image width is 8, expected 16 to 8192"),
        (["--seed", "-1", "--checkerboard"], "seed is -1"),
        (["--cameras", "-1", "--checkerboard"], "--cameras is -1, expected 2 to 99"),
        (["--cameras", "100"], "--cameras is 100, expected 2 to 99"),
        (["--noise", "-3"], "noise is -3"),
        (["--stature", "172"], "stature is 172"),
        (["--seed", "-1"], "seed is -1"),
        (["--body", "spider"], "body 'spider' is unknown"),
        (["--shadow", "2"], "shadow is 2, expected 0 to 1"),
        (["--checkerboard", "--charuco"], "--checkerboard and --charuco are two boards"),
    ],
)
def test_impossible_arguments_fail_in_one_line_without_a_folder(
    tmp_path: Path, capfd, words: list[str], expected: str
) -> None:
    assert main(["synthesize", str(tmp_path / "out"), *words]) == 1
    out, err = capfd.readouterr()
    assert out == "" and re.search(expected, err), err
    assert err.strip().splitlines()[-1].startswith("markerless_tracker: error: ")
    assert list(tmp_path.iterdir()) == []


def test_unknown_motion_is_a_wrong_argument(tmp_path: Path, capsys) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["synthesize", str(tmp_path / "out"), "--motion", "fly"])
    assert stop.value.code == 2 and "fly" in capsys.readouterr().err


def test_a_folder_that_is_not_empty_is_not_changed(tmp_path: Path, capsys) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("keep")
    assert main(["synthesize", str(tmp_path / "out"), *SMALL]) == 1
    assert "out: exists and is not empty" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["mine.txt"]
