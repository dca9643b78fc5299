"""The verb `convert`, as a user calls it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import open_recording


def test_json_alone_is_on_standard_output(make_recording, tmp_path: Path, capsys) -> None:
    folder = make_recording(frames=7, fps=60.0)
    words = ["convert", str(folder), str(tmp_path / "bag"), "--fps", "20", "--scale", "0.5"]
    assert main([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["cameras"] == ["cam01", "cam02"] and summary["size_px"]["cam01"] == [32, 24]
    assert (summary["frames"], summary["fps"], summary["compress"]) == (3, 20.0, "none")
    assert (summary["first_ns"], summary["last_ns"], summary["warnings"]) == (0, 100_000_000, [])
    stamps = [s.stamp_ns for s in open_recording(tmp_path / "bag").frames()]
    assert stamps == [0, 50_000_000, 100_000_000]
    assert summary["bytes"] == sum(f.stat().st_size for f in (tmp_path / "bag").rglob("*.*"))


def test_one_line_of_text(make_recording, tmp_path: Path, capsys) -> None:
    words = ["convert", str(make_recording()), str(tmp_path / "bag"), "--compress", "zstd"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert re.search(r"bag: 6 sets at 60 fps, cam01 64x48, cam02 64x48, \d+\.\d MB\n$", out)


def test_a_missing_background_is_learned_and_reported(
    make_recording, tmp_path: Path, capsys
) -> None:
    folder = make_recording(backgrounds=0)
    assert main(["convert", str(folder), str(tmp_path / "bag")]) == 0
    summary = capsys.readouterr().err
    assert summary.count("background learned from") == 2
    found = open_recording(tmp_path / "bag").background_frames()
    assert {name: images[0].shape for name, images in found.items()} == {
        "cam01": (48, 64, 3),
        "cam02": (48, 64, 3),
    }


def test_numbered_images_with_their_rate(make_recording, tmp_path: Path, capsys) -> None:
    from markerless_tracker.datasets import write_image

    folder = make_recording()
    for name in ("cam01", "cam02"):
        (folder / f"{name}.mkv").unlink()
        for index in range(3):
            write_image(folder / name / f"{index}.png", np.full((48, 64, 3), index, np.uint8))
    words = ["convert", str(folder), str(tmp_path / "bag")]
    assert main(words) == 1
    assert "--input-fps" in capsys.readouterr().err
    assert main([*words, "--input-fps", "25", "--format", "folder"]) == 0
    sets = list(open_recording(tmp_path / "bag").frames())
    assert [s.stamp_ns for s in sets] == [0, 40_000_000, 80_000_000]
    assert sets[2].images["cam02"].max() == 2


@pytest.mark.parametrize(
    ("extra", "reported"),
    [
        (["--fps", "25"], "fps 25.*30 or 20|fps 25.*20 or 30"),
        (["--fps", "0"], "fps 0"),
        (["--scale", "2"], "scale 2"),
        (["--scale", "nan"], "scale nan"),
        (["--input-fps", "-3"], "input fps -3"),
        (["--format", "bag"], "no bag"),
        (["--format", "pose2sim"], "no calibration folder"),
    ],
)
def test_impossible_options_fail_in_one_line(
    make_recording, tmp_path: Path, capsys, extra: list[str], reported: str
) -> None:
    assert main(["convert", str(make_recording()), str(tmp_path / "bag"), *extra]) == 1
    captured = capsys.readouterr()
    assert re.search(reported, captured.err) and captured.err.count("\n") == 1 and not captured.out
    assert not (tmp_path / "bag").exists()


def test_an_unreadable_image_leaves_no_bag(make_recording, tmp_path: Path, capsys) -> None:
    from markerless_tracker.datasets import write_image

    folder = make_recording(name="images")
    for name in ("cam01", "cam02"):
        (folder / f"{name}.mkv").unlink()
        for index in range(4):
            write_image(folder / name / f"{index}.png", np.zeros((48, 64, 3), np.uint8))
    (folder / "cam02" / "2.png").write_bytes(b"broken")
    words = ["convert", str(folder), str(tmp_path / "bag"), "--input-fps", "25", "--json"]
    assert main(words) == 1
    captured = capsys.readouterr()
    assert "2.png: cannot be read" in captured.err and not captured.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["images"]


def test_a_target_that_is_not_empty_is_not_changed(make_recording, tmp_path: Path, capsys) -> None:
    folder = make_recording()
    assert main(["convert", str(folder), str(folder)]) == 1
    assert "exists and is not empty" in capsys.readouterr().err
    assert (folder / "cam01.mkv").is_file()


def test_an_earlier_bag_is_replaced_with_force_only(make_recording, tmp_path: Path, capsys) -> None:
    bag = tmp_path / "bag"
    assert main(["convert", str(make_recording(frames=3)), str(bag)]) == 0
    longer = str(make_recording("longer", frames=5))
    assert main(["convert", longer, str(bag)]) == 1
    assert "expected a new or an empty folder (--force replaces a bag)" in capsys.readouterr().err
    assert open_recording(bag).frame_count == 3
    assert main(["convert", longer, str(bag), "--force"]) == 0
    assert open_recording(bag).frame_count == 5
    other = tmp_path / "mine"
    other.mkdir()
    (other / "notes.txt").write_text("kept", encoding="utf-8")
    assert main(["convert", longer, str(other), "--force"]) == 1
    assert (other / "notes.txt").read_text(encoding="utf-8") == "kept"
    assert not list(tmp_path.glob(".*"))
