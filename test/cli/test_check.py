"""The verb `check`, on recordings as they should be and as they should not."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from markerless_tracker.camera import CameraRig, write_calibration
from markerless_tracker.checks.recording import floor_middle
from markerless_tracker.cli.main import main
from markerless_tracker.datasets import new_recording
from markerless_tracker.synthesis import SyntheticScene, ring_rig

FRAMES = 60


@pytest.fixture(scope="module")
def scene():
    return SyntheticScene(size_px=(328, 246), fps=15.0, seed=2, samples=1)


@pytest.fixture(scope="module")
def frames(scene):
    """The person stops and goes: a steady walk does not tell cameras' offsets."""
    steps = np.random.default_rng(0).choice([0, 0, 0, 1, 2], FRAMES + 6)
    drawn = [scene.frame(i)[0] for i in range(int(steps.sum()) + 1)]
    return [drawn[i] for i in np.cumsum(steps)]


def written(path, scene, frames, backgrounds):
    with new_recording(path, scene.rig, scene.fps) as writer:
        for name, images in backgrounds.items():
            writer.write_background(name, images)
        for views in frames[:FRAMES]:
            writer.write(views)
    return path


def checked(path, capsys):
    status = main(["check", str(path), "--json"])
    summary = json.loads(capsys.readouterr().out)
    return status, summary["findings"]


def test_a_good_recording_has_no_red_line(tmp_path: Path, scene, frames, capsys) -> None:
    path = written(tmp_path / "good", scene, frames, scene.backgrounds(2))
    status, found = checked(path, capsys)
    assert status == 0 and {f["state"] for f in found} <= {"green", "yellow"}
    assert {f["check"] for f in found} == {
        "calibration", "views", "in step", "background", "light", "person"
    }  # fmt: skip
    tall = [f for f in found if f["check"] == "person"]
    assert all(90 < int(f["text"].split()[1]) < 180 for f in tall) and len(tall) == 4
    assert main(["check", str(path)]) == 0
    assert "0 red" in capsys.readouterr().out


def test_a_grey_background_of_colour_images_is_a_red_line(
    tmp_path: Path, scene, frames, capsys
) -> None:
    path = written(tmp_path / "grey", scene, frames, scene.backgrounds(1))
    (file,) = (path / "background").glob("cam02.*")
    cv2.imwrite(str(file), cv2.imread(str(file), cv2.IMREAD_GRAYSCALE))
    status, found = checked(path, capsys)
    red = [f for f in found if f["state"] == "red"]
    assert status == 3 and [(f["check"], f["camera"]) for f in red] == [("background", "cam02")]
    assert "partly grey, partly in colour" in red[0]["text"]


def test_red_lines_name_the_camera_and_say_what_to_do(
    tmp_path: Path, scene, frames, capsys
) -> None:
    """cam01 late by 6 frames, cam02 and cam03 with each other's background, cam04 ever brighter."""
    wrong = []
    for i in range(FRAMES):
        views = dict(frames[i + 6])
        views["cam01"] = frames[i]["cam01"]
        views["cam04"] = np.minimum(views["cam04"] * (0.6 + 0.6 * i / FRAMES), 255).astype("uint8")
        wrong.append(views)
    empty = scene.backgrounds(1)
    empty["cam02"], empty["cam03"] = empty["cam03"], empty["cam02"]
    path = written(tmp_path / "wrong", scene, wrong, empty)
    status, found = checked(path, capsys)
    red = {(f["check"], f["camera"]): f for f in found if f["state"] == "red"}
    assert status == 3
    assert {("in step", "cam01"), ("background", "cam02"), ("light", "cam04")} <= set(red)
    assert "+6" in red["in step", "cam01"]["text"]
    assert "--time-offsets cam01=-0.4" in red["in step", "cam01"]["advice"]
    assert "that of cam03's background" in red["background", "cam02"]["text"]
    assert all(f["advice"] for f in red.values())
    assert not {name for check, name in red if check == "in step"} - {"cam01"}
    assert main(["check", str(path)]) == 3
    assert "RED  light: cam04" in capsys.readouterr().out


def test_one_camera_is_too_few(tmp_path: Path, scene, frames, capsys) -> None:
    path = tmp_path / "one"
    with new_recording(path, CameraRig(scene.rig.cameras[:1]), scene.fps) as writer:
        for views in frames[:12]:
            writer.write({"cam01": views["cam01"]})
    status, found = checked(path, capsys)
    (calibration,) = [f for f in found if f["check"] == "calibration"]
    assert status == 3 and (calibration["state"], calibration["text"]) == ("red", "one camera")
    assert "from two on" in calibration["advice"]
    assert [f for f in found if f["check"] == "views"] == []


def test_cameras_that_see_the_floor_too_near_and_other_units(
    tmp_path: Path, scene, frames, capsys
) -> None:
    near = CameraRig(ring_rig(2, (328, 246), distance_m=1.5).cameras + scene.rig.cameras[2:])
    path = written(tmp_path / "near", scene, frames[:12], {})
    write_calibration(path / "calibration.toml", near)
    status, found = checked(path, capsys)
    views = next(f for f in found if f["check"] == "views")
    assert status == 3 and views["state"] == "red" and views["text"].startswith("2 of 4 cameras")
    assert [f["text"] for f in found if f["check"] == "background"] == ["no empty-scene image"] * 4
    text = (path / "calibration.toml").read_text()
    (path / "calibration.toml").write_text(text.replace("translation = [", "translation = [9e3, "))
    assert main(["check", str(path)]) == 1
    assert "translation" in capsys.readouterr().err


def test_a_calibration_in_other_axes_and_units_is_read_as_track_reads_it(
    tmp_path: Path, scene, frames, capsys
) -> None:
    path = written(tmp_path / "mm", scene, frames[:12], {})
    status, expected = checked(path, capsys)
    calibration = path / "calibration.toml"
    text = calibration.read_text(encoding="utf-8")
    lines = [
        f"translation = {[1000.0 * float(x) for x in line.split('=')[1].strip(' []').split(',')]}"
        if line.startswith("translation")
        else line
        for line in text.splitlines()
    ]
    calibration.write_text("\n".join(lines), encoding="utf-8")
    words = ["check", str(path), "--json", "--units", "mm", "--format", "folder", "--up=z"]
    assert main(words) == status
    assert json.loads(capsys.readouterr().out)["findings"] == expected


def test_the_middle_of_the_floor_is_what_all_cameras_look_at() -> None:
    rig = ring_rig(4, target_m=(0.7, -0.4, 0.9))
    np.testing.assert_allclose(floor_middle(rig), [0.7, -0.4, 0.0], atol=0.05)
