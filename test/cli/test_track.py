"""Verb `track`, from a synthetic recording to its result."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from markerless_tracker.bags import write_bag
from markerless_tracker.cli.main import main
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.datasets import open_recording, read_trc
from markerless_tracker.results.score import score
from markerless_tracker.synthesis import SyntheticScene
from markerless_tracker.tracking import TrackerConfig

SEARCH: dict[str, Any] = {
    "body": "balan31",
    "optimizer": "sppso",
    "evaluations": 200,
    "refinement": "none",
    "fit_shape": False,
    "sigma": {"scale": 0.5},
    "edges.spacing_px": 4.0,
    "edge_weight": 0.5,
    "limits": "anatomical",
    "collision": "elliptic",
    "seed": 3,
}
FRAMES = 4


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four frames at 60 Hz of a synthetic person."""
    folder = tmp_path_factory.mktemp("made-up") / "walk"
    scene = SyntheticScene(body="balan31", motion="walk", size_px=(192, 144), seed=4, noise=2.0)
    synthesize(folder, scene, frames=FRAMES, lossless=True)
    return folder


@pytest.fixture
def settings(tmp_path: Path) -> Path:
    path = tmp_path / "settings.yaml"
    path.write_text(yaml.safe_dump(SEARCH), encoding="utf-8")
    return path


@pytest.fixture
def track(walk, settings, tmp_path, capsys):
    """`track(*words)`: status, standard output, standard error; writes `out.trc` and `out.json`."""

    def run(*words: object, source: Path = walk, config: Path = settings) -> tuple[int, str, str]:
        given = ["track", source, "-o", tmp_path / "out", "--config", config, *words]
        status = main([str(word) for word in given])
        return status, *capsys.readouterr()

    return run


def refusal(outcome: tuple[int, str, str]) -> str:
    """The one line that a failed command ends with."""
    status, out, err = outcome
    assert status == 1
    assert out == ""
    lines = [line for line in err.splitlines() if line.startswith("markerless_tracker: error: ")]
    assert len(lines) == 1
    assert "Traceback" not in err
    assert err.endswith(lines[0] + "\n")
    return lines[0].removeprefix("markerless_tracker: error: ")


def test_a_recording_becomes_markers_and_a_summary(track, walk, tmp_path):
    status, out, _ = track("--start", walk / "ground_truth.trc")
    assert status == 0
    assert f"{tmp_path / 'out.trc'}: 4 frames, 4 tracked, 0 lost, " in out
    found = score(read_trc(tmp_path / "out.trc"), read_trc(walk / "ground_truth.trc"))
    assert found.frames == FRAMES
    assert found.mean_mm < 40.0
    data = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    used = TrackerConfig.from_mapping(data["settings"])
    assert used == TrackerConfig.from_mapping(SEARCH)
    assert data["source"] == str(walk.resolve()) and data["scale"] == 1.0
    assert data["recording"] == walk.name
    assert data["reading"] == {"format": None, "input_fps": None, "up": "z", "units": "m"}
    assert [frame["evaluations"] for frame in data["frames"]] == [200] * FRAMES


def test_json_alone_on_standard_output(track, walk, tmp_path):
    status, out, err = track("--start", walk / "ground_truth.trc", "--json")
    assert status == 0
    summary = json.loads(out)
    assert summary["result"] == str(tmp_path / "out.trc")
    assert summary["source"] == str(walk)
    assert summary["frames"] == summary["tracked"] == FRAMES
    assert summary["states"] == {"TRACKING": FRAMES}
    assert summary["frames_per_s"] > 0
    assert summary["warnings"] == summary["frame_warnings"] == []
    assert err == ""


def test_a_pose_and_a_subject_from_yaml(track, walk, tmp_path):
    status, _, _ = track("--start", walk / "start.yaml", "--subject", walk / "subject.yaml")
    assert status == 0
    found = score(read_trc(tmp_path / "out.trc"), read_trc(walk / "ground_truth.trc"))
    assert found.mean_mm < 40.0


def test_flags_take_precedence_over_the_settings_file(track, walk, tmp_path):
    status, _, _ = track(
        "--start", walk / "ground_truth.trc", "--evaluations", 100, "--seed", 8, "--threads", 2,
        "--preset", "paper",
    )  # fmt: skip
    assert status == 0
    used = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["settings"]
    assert (used["evaluations"], used["seed"], used["threads"]) == (100, 8, 2)
    assert (used["preset"], used["edges"]["rule"]) == ("paper", "visible")
    # What the file says stands above the preset.
    assert used["sigma"]["scale"] == SEARCH["sigma"]["scale"]


def test_fps_scale_and_background(track, walk, tmp_path):
    status, out, _ = track(
        "--start", walk / "ground_truth.trc", "--fps", 30, "--scale", 0.5,
        "--background", walk / "background", "--json",
    )  # fmt: skip
    assert status == 0
    assert json.loads(out)["frames"] == 2
    stamps = read_trc(tmp_path / "out.trc").stamps_ns
    np.testing.assert_array_equal(stamps, [0, 33_333_333])
    assert (tmp_path / "out.trc").read_text(encoding="utf-8").splitlines()[2].startswith("30\t")


def test_the_rate_of_the_result_is_that_of_its_frames(track, walk, tmp_path):
    words = ("--start", walk / "ground_truth.trc", "--fps", 30.2)
    assert track(*words)[0] == 0
    np.testing.assert_array_equal(read_trc(tmp_path / "out.trc").stamps_ns, [0, 33_333_333])
    assert (tmp_path / "out.trc").read_text(encoding="utf-8").splitlines()[2].startswith("30\t")
    line = refusal(track(*words, "--smooth", 15.05, "--force"))
    assert "smooth is 15.05 Hz, expected from 0.1 to 15, half the rate" in line


def test_debug_images_for_every_frame_and_camera(track, walk, tmp_path):
    status, _, _ = track("--start", walk / "ground_truth.trc", "--debug-images", tmp_path / "see")
    assert status == 0
    written = sorted(p.relative_to(tmp_path / "see").as_posix() for p in tmp_path.rglob("*.jpg"))
    assert written == [f"cam0{c}/{i:06d}.jpg" for c in range(1, 5) for i in range(FRAMES)]
    picture = cv2.imread(str(tmp_path / "see" / "cam01" / "000000.jpg"))
    assert picture.shape == (144, 6 * 192, 3)


def test_the_same_result_without_debug_images(track, walk, tmp_path):
    track("--start", walk / "ground_truth.trc", "--debug-images", tmp_path / "see")
    first = (tmp_path / "out.trc").read_bytes()
    track("--start", walk / "ground_truth.trc")
    assert (tmp_path / "out.trc").read_bytes() == first


class TestRefusals:
    def test_no_subject(self, track, walk):
        assert "start.yaml gives a pose but no subject" in refusal(
            track("--start", walk / "start.yaml")
        )

    def test_a_start_that_is_no_pose(self, track, walk):
        line = refusal(track("--start", walk / "calibration.toml", "--stature", "1.7"))
        assert "calibration.toml: no start pose, expected the markers (.trc) or a pose" in line

    def test_a_calibration_that_could_not_be_written_afterwards(self, track, walk, tmp_path):
        (tmp_path / "file").write_text("")
        path = tmp_path / "file" / "refined.toml"
        line = refusal(track("--start", walk / "start.yaml", "--refine-calibration", path))
        assert "refined.toml: cannot be written" in line

    def test_a_calibration_that_is_there_is_kept(self, track, walk, tmp_path):
        path = tmp_path / "mine.toml"
        path.write_text("# mine", encoding="utf-8")
        line = refusal(track("--start", walk / "start.yaml", "--refine-calibration", path))
        assert line == f"{path}: exists already, expected a new name or --force"
        assert path.read_text(encoding="utf-8") == "# mine"

    def test_an_unknown_setting(self, track, walk, tmp_path):
        path = tmp_path / "typo.yaml"
        path.write_text("edge_wieght: 1.0\n", encoding="utf-8")
        line = refusal(track("--start", walk / "ground_truth.trc", config=path))
        assert line == f"{path}: unknown setting 'edge_wieght', did you mean 'edge_weight'?"

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("edge_weight: heavy", "edge_weight: got 'heavy', expected float"),
            ("preset: [paper]", "preset is ['paper'], expected one of tuned, paper"),
            ("- 1\n- 2", "expected a mapping of settings, got list"),
            ("just words", "expected a mapping of settings, got str"),
            ("a: [1, 2", "cannot read the settings: "),
            ("a: b: c", "cannot read the settings: "),
            pytest.param("[" * 5000, "cannot read the settings: maximum recursion", id="deep"),
        ],
    )
    def test_malformed_settings_files(self, track, walk, tmp_path, text, message):
        path = tmp_path / "wrong.yaml"
        path.write_text(text + "\n", encoding="utf-8")
        line = refusal(track("--start", walk / "ground_truth.trc", config=path))
        assert message in line and line.startswith(f"{path}: ")

    def test_a_missing_settings_file(self, track, walk, tmp_path):
        line = refusal(
            track("--start", walk / "ground_truth.trc", config=tmp_path / "nothing.yaml")
        )
        assert "nothing.yaml: cannot read the settings" in line

    def test_an_empty_settings_file_sets_nothing(self, track, tmp_path):
        path = tmp_path / "empty.yaml"
        path.write_text("", encoding="utf-8")
        assert "nowhere.trc" in refusal(track("--start", tmp_path / "nowhere.trc", config=path))

    def test_an_impossible_budget(self, track, walk):
        line = refusal(track("--start", walk / "ground_truth.trc", "--evaluations", 1050))
        assert line.endswith("which sppso cannot spend exactly: nearest are 1000 or 1100")

    def test_a_missing_source(self, track, walk, tmp_path):
        line = refusal(track("--start", walk / "ground_truth.trc", source=tmp_path / "nowhere"))
        assert "nowhere" in line

    def test_an_impossible_rate(self, track, walk):
        line = refusal(track("--start", walk / "ground_truth.trc", "--fps", 25))
        assert line.startswith("fps 25: the source has 60")
        line = refusal(track("--start", walk / "ground_truth.trc", "--fps", 0))
        assert line.startswith("fps 0: expected a rate above 0")

    def test_an_impossible_scale(self, track, walk):
        line = refusal(track("--start", walk / "ground_truth.trc", "--scale", 2))
        assert "scale 2: expected above 0 and at most 1" in line

    def test_a_result_that_cannot_be_written(self, track, walk, tmp_path):
        (tmp_path / "out.trc").mkdir()
        line = refusal(track("--force", "--start", walk / "ground_truth.trc"))
        assert f"{tmp_path / 'out.trc'}: cannot be written" in line

    def test_debug_images_that_cannot_be_written(self, track, walk, tmp_path):
        (tmp_path / "file").write_text("a file", encoding="utf-8")
        line = refusal(
            track("--start", walk / "ground_truth.trc", "--debug-images", tmp_path / "file" / "see")
        )
        assert "see: cannot be made: " in line

    def test_missing_arguments(self, capsys):
        with pytest.raises(SystemExit) as caught:
            main(["track"])
        assert caught.value.code == 2
        assert "the following arguments are required: SOURCE, -o" in capsys.readouterr().err


def test_help_has_an_example(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["track", "--help"])
    assert caught.value.code == 0
    assert "example:\n  markerless_tracker track " in capsys.readouterr().out


def test_a_cut_bag_is_tracked_up_to_the_cut(track, walk, tmp_path):
    bag = tmp_path / "bag"
    write_bag(open_recording(walk), bag)
    file = bag / "bag.mcap"
    content = file.read_bytes()
    file.write_bytes(content[: int(0.6 * len(content))])
    status, out, err = track("--json", "--start", walk / "ground_truth.trc", source=bag)
    summary = json.loads(out)
    assert status == 0 and summary["frames"] == summary["tracked"] == 2
    assert " ".join(err.split()).count("cut or damaged, read up to there") == 1
    assert any("cut or damaged" in warning for warning in summary["warnings"])
