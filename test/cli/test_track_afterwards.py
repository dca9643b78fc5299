"""Verb `track`: existing results, lost frames, silhouettes made elsewhere, offsets, smoothing.

Also the refinement of the calibration.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import read_trc
from markerless_tracker.results.read import read_result
from markerless_tracker.results.score import score
from markerless_tracker.synthesis import SyntheticScene


@pytest.fixture
def track(walk, search, tmp_path, capsys):
    """`track(*words)`: status, standard output, standard error; writes `out.*`."""
    config = tmp_path / "settings.yaml"
    quick = {**search, "evaluations": 200, "refinement": "none", "fit_shape": False}
    config.write_text(yaml.safe_dump(quick), encoding="utf-8")

    def run(*words: object) -> tuple[int, str, str]:
        given = ["track", walk, "-o", tmp_path / "out", "--config", config, *words]
        given += ["--start", walk / "ground_truth.trc"]
        return main([str(word) for word in given]), *capsys.readouterr()

    return run


def test_an_earlier_result_is_replaced_with_force_only(track, tmp_path: Path) -> None:
    assert track()[0] == 0
    before = (tmp_path / "out.trc").read_bytes()
    status, _, err = track("--seed", 7)
    assert status == 1 and "out.trc: exists already, expected a new name or --force" in err
    assert (tmp_path / "out.trc").read_bytes() == before
    assert track("--seed", 7, "--force")[0] == 0
    assert (tmp_path / "out.trc").read_bytes() != before


@pytest.fixture
def masks(walk, tmp_path: Path) -> Path:
    """True silhouettes of the recording `walk`, as images."""
    scene = SyntheticScene(
        body="balan31", motion="walk", size_px=(192, 144), fps=30.0, seed=4, noise=2.0
    )
    for index in range(6):
        for name, mask in scene.frame(index)[1].items():
            path = tmp_path / "masks" / name / f"{index:06d}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), np.where(mask, 255, 0).astype(np.uint8))
    return tmp_path / "masks"


def test_silhouettes_made_elsewhere(track, masks, walk, tmp_path: Path) -> None:
    status, out, _ = track("--masks", masks)
    assert status == 0 and "6 tracked" in out
    reference = read_trc(walk / "ground_truth.trc")
    found = score(read_trc(tmp_path / "out.trc"), reference)
    assert found.frames == 6 and found.mean_mm < 30.0
    for file in (masks / "cam02").iterdir():
        cv2.imwrite(str(file), np.zeros((144, 192), np.uint8))
    assert track("--masks", masks, "--force")[0] == 0
    worse = score(read_trc(tmp_path / "out.trc"), reference)
    assert worse.mean_mm != found.mean_mm, "the silhouettes decide, not the images"


def test_frames_without_any_silhouette_are_left_out(track, masks, tmp_path: Path) -> None:
    for file in (*masks.glob("*/000003.png"), *masks.glob("cam01/000004.png")):
        file.unlink()
    status, out, err = track("--masks", masks)
    assert status == 0 and out.partition(": ")[2].startswith("5 frames, 5 tracked")
    assert "1 of 6 frames left out, no camera has a silhouette" in err
    for file in masks.glob("*/*.png"):
        file.rename(file.with_stem(f"1{file.stem}"))
    status, _, err = track("--masks", masks, "--force")
    assert status == 1 and "no silhouette of any of the 6 frames read" in err


def test_impossible_silhouettes_fail_in_one_line(track, masks, tmp_path: Path) -> None:
    status, _, err = track("--masks", masks, "--debug-images", tmp_path / "debug")
    assert status == 1 and "which --masks replaces" in err
    status, _, err = track("--masks", masks, "--background", tmp_path / "none")
    assert status == 1 and "--background is for the segmentation, which --masks replaces" in err
    (masks / "cam01" / "some.png").write_bytes(b"")
    status, _, err = track("--masks", masks)
    assert status == 1 and "some.png: expected a frame number" in err
    status, _, err = track("--masks", tmp_path)
    assert status == 1 and "no folder cam01, cam02" in err


def test_smoothing_and_offsets(track, tmp_path: Path) -> None:
    status, out, _ = track("--smooth", "--fill-gaps", "0.2", "--json")
    assert status == 0 and json.loads(out)["filled"] == 0
    result = read_result(tmp_path / "out")
    assert result.summary["smoothing"]["cutoff_hz"] == 6.0
    status, _, err = track("--smooth", "100", "--force")
    assert status == 1 and "smooth is 100 Hz, expected from 0.1 to 15, half the rate" in err
    assert read_result(tmp_path / "out").summary["smoothing"]["cutoff_hz"] == 6.0
    status, _, err = track("--time-offsets", "cam09=1", "--force")
    assert status == 1 and "no camera cam09" in err
    status, _, err = track("--time-offsets", "cam02=-0.0333", "--force")
    assert status == 0 and len(read_trc(tmp_path / "out.trc")) == 5
    assert read_result(tmp_path / "out").summary["time_offsets_s"] == {"cam02": -0.0333}


def test_a_calibration_is_not_refined_by_a_person_who_hardly_moves(track, tmp_path: Path) -> None:
    status, out, err = track("--refine-calibration", tmp_path / "new.toml")
    assert status == 1 and "6 tracked" in out
    assert "new.toml: not written: the person hardly moves: 6 frames are as good as 1." in err
    assert "walks through the whole volume" in err and "Traceback" not in err
    assert not (tmp_path / "new.toml").exists()
    assert len(read_trc(tmp_path / "out.trc").stamps_ns) == 6
    status, out, _ = track("--force", "--json", "--refine-calibration", tmp_path / "new.toml")
    assert status == 1
    assert json.loads(out)["calibration"]["path"] is None
    assert "hardly moves" in json.loads(out)["calibration"]["refused"]
