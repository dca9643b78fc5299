"""The verb `benchmark`, as a user calls it."""

import csv
import json
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.cli.synthesize import synthesize
from markerless_tracker.synthesis import SyntheticScene


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A made-up walk of a few small frames."""
    scene = SyntheticScene(body="person31", cameras=3, size_px=(200, 152), samples=1)
    folder = tmp_path_factory.mktemp("made") / "walk"
    synthesize(folder, scene, frames=4, lossless=True)
    return str(folder)


def test_the_same_figures_as_track_and_evaluate(walk, tmp_path: Path, capsys) -> None:
    words = ["tables", walk, "--preset", "tuned", "--fps", "30", "--seeds", "1", "--json"]
    assert main(["benchmark", *words]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    truth = f"{walk}/ground_truth.trc"
    result = str(tmp_path / "result")
    assert (
        main(["track", walk, "-o", result, "--start", truth, "--fps", "30", "--threads", "2"]) == 0
    )
    capsys.readouterr()
    assert main(["evaluate", f"{result}.trc", truth, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    # Marker files hold µm.
    for key in ("mean_mm", "max_mm", "worst_joint_mm", "limbs_mm"):
        assert row[key] == pytest.approx(told[key], abs=2e-3)
    assert row["joints"] == pytest.approx(told["joints"], abs=2e-3)
    assert row["frames"] == told["frames"] == 2
    frames = json.loads(Path(f"{result}.json").read_text())["frames"]
    assert row["evaluations"] == sum(frame["evaluations"] for frame in frames) / 2


def test_tables_for_people_and_on_disk(walk, tmp_path: Path, capsys) -> None:
    config = tmp_path / "settings.yaml"
    config.write_text("fit_shape: false\nrefine_iterations: 2\n")
    words = [
        "tables", walk, "--config", str(config), "--body", "balan31,person31", "--refinement",
        "contour,none", "--seeds", "1", "--frames", "1", "--evaluations", "1000", "--fps", "60",
        "--start-noise", "5", "--truth-score", "-o", str(tmp_path / "out"), "--jobs", "1",
    ]  # fmt: skip
    assert main(["benchmark", *words]) == 0
    out = capsys.readouterr().out
    assert "walk, 1 seed, start disturbed by 5 mm" in out and "f truth-result" in out
    assert "±" in out and "person31" in out
    with (tmp_path / "out" / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["body"], row["refinement"]) for row in rows] == [
        ("balan31", "contour"), ("balan31", "none"), ("person31", "contour"), ("person31", "none"),
    ]  # fmt: skip
    table = json.loads((tmp_path / "out" / "table.json").read_text())
    assert float(rows[0]["mean_mm"]) == table["rows"][0]["mean_mm"]
    assert {"cpu", "cores"} <= set(table["machine"]) and "numba" in table["versions"]
    assert [row["refinements"] for row in table["rows"]][1::2] == [0, 0]
    assert all(row["truth_difference"] is not None for row in table["rows"])
    assert len(list((tmp_path / "out" / "runs").glob("walk-*.json"))) == 4


def test_both_presets_unless_named(walk, capsys) -> None:
    words = ["tables", walk, "--seeds", "1", "--frames", "1", "--jobs", "1", "--json"]
    assert main(["benchmark", *words]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["preset"], row["body"], row["fps"]) for row in rows] == [
        ("tuned", "person31", 60.0), ("tuned", "person31", 20.0),
        ("paper", "balan31", 60.0), ("paper", "balan31", 20.0),
    ]  # fmt: skip
    assert rows[2]["evaluations"] == 1000


def test_speed_of_a_recording(walk, capsys) -> None:
    words = ["speed", walk, "--threads", "1", "--frames", "1", "--repeats", "1"]
    assert main(["benchmark", *words, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["source"] == "walk" and figures["frames"] == 2
    assert {"machine", "versions", "reference_ratio", "refine_ms"} <= set(figures)


def test_the_table_of_speed(capsys) -> None:
    from rich.console import Console

    from markerless_tracker.cli.benchmark.speed import speed_table

    spread = {"median": 1.25, "p95": 2.5}
    figures = {
        "view_evaluation_us": {"full": 6.6, "person31": 9.9, "reference": 198.0},
        "reference_ratio": 30.0, "person31_ratio": 1.5, "swarm_ms": {"sppso_1000": spread},
        "refine_ms": 0.345, "refine_setup_ms": 4.0, "thousand_evaluations_ms": spread,
        "frame_ms": dict.fromkeys(("background", "edges", "fitness", "total"), spread),
        "fit_vs_1000_evaluations": 0.5,
    }  # fmt: skip
    Console(width=100).print(speed_table(figures))
    out = capsys.readouterr().out
    assert "198.0" in out and "0.345" in out and "1.25" in out


@pytest.mark.parametrize(
    ("words", "said", "status"),
    [
        ([], "required: KIND", 2),
        (["tables"], "required: SOURCE", 2),
        (["tables", "x", "--seeds", "0"], "expected a whole number from 1", 2),
        (["tables", "x", "--fps", "60,,20"], "no list with commas", 2),
        (["tables", "x", "--fps", "0"], "expected a number above 0", 2),
        (["tables", "x", "--start-noise", "nan"], "expected a number from 0", 2),
        (["tables", "nowhere"], "nowhere: no such file or folder", 1),
        (["tables", "nowhere", "--preset", "best"], "preset is 'best'", 1),
        (["tables", "nowhere", "--refinement", "magic"], "refinement: got 'magic'", 1),
        (["speed", "nowhere"], "nowhere: no such file or folder", 1),
        (["speed", "--threads", "-1", "--frames", "1"], "threads: got -1", 1),
    ],
)
def test_what_cannot_be_done_says_so_in_one_line(words, said, status, capsys) -> None:
    try:
        code = main(["benchmark", *words])
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    assert code == status and not captured.out
    last = captured.err.strip().splitlines()[-1]
    assert said in last and "Traceback" not in captured.err


def test_starts_without_a_start(walk, capsys) -> None:
    words = ["start", walk, "--stature", "1.72", "--every", "2", "--frames", "2", "--threads", "1"]
    assert main(["benchmark", *words, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["count"] == len(row["starts"]) == 2 and row["found"] == 1.0
    assert [start["frame"] for start in row["starts"]] == [0, 2]
    assert row["reached"] == 1.0 and row["wrong_heading"] == 0.0


def test_values_for_each_recording(walk, capsys) -> None:
    assert main(["benchmark", "start", walk, "--stature", "1.72,1.8"]) == 1
    assert "--stature: 2 values for 1 recordings" in capsys.readouterr().err


def test_what_a_recording_is_too_short_for_is_left_out(walk, capsys) -> None:
    words = ["recovery", walk, "--stature", "1.72", "--seeds", "1", "--threads", "1", "--json"]
    assert main(["benchmark", *words]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["runs"] == [] and len(row["usual_mm"]) == 1
