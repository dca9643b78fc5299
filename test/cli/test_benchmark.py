"""The verb `benchmark` from the command line."""

import csv
import json
import shutil
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
    scored = json.loads(capsys.readouterr().out)
    # Marker files hold µm.
    for key in ("mean_mm", "max_mm", "worst_joint_mm", "limbs_mm"):
        assert row[key] == pytest.approx(scored[key], abs=2e-3)
    assert row["joints"] == pytest.approx(scored["joints"], abs=2e-3)
    assert row["frames"] == scored["frames"] == 2
    frames = json.loads(Path(f"{result}.json").read_text())["frames"]
    assert row["evaluations"] == sum(frame["evaluations"] for frame in frames) / 2


def test_tables_for_people_and_on_disk(walk, tmp_path: Path, capsys) -> None:
    config = tmp_path / "settings.yaml"
    config.write_text("fit_shape: false\nrefine:\n  iterations: 2\n")
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


def test_both_presets_by_default(walk, capsys) -> None:
    words = ["tables", walk, "--seeds", "1", "--frames", "1", "--jobs", "1", "--json"]
    assert main(["benchmark", *words]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["preset"], row["body"], row["fps"]) for row in rows] == [
        ("tuned", "person32", 60.0), ("tuned", "person32", 20.0),
        ("paper", "balan31", 60.0), ("paper", "balan31", 20.0),
    ]  # fmt: skip
    assert rows[2]["evaluations"] == 1000


def test_stored_runs_are_not_repeated(walk, tmp_path: Path, capsys) -> None:
    words = [
        "tables", walk, "--preset", "paper", "--optimizer", "sppso,apf,hmcpso", "--seeds", "1",
        "--frames", "1", "--fps", "60", "-o", str(tmp_path), "--jobs", "1",
    ]  # fmt: skip
    assert main(["benchmark", *words]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in ("optimizer", "sppso", "apf", "hmcpso"))
    kept = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "runs").iterdir()}
    assert main(["benchmark", *words, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["optimizer"], row["body"], row["evaluations"]) for row in rows] == [
        ("sppso", "balan31", 1000), ("apf", "humaneva34", 3600), ("hmcpso", "humaneva34", 3600)
    ]  # fmt: skip
    assert kept == {path.name: path.stat().st_mtime_ns for path in (tmp_path / "runs").iterdir()}
    assert len(kept) == 3


def test_a_recording_given_twice_is_measured_once(walk, capsys) -> None:
    words = ["--preset", "tuned", "--seeds", "1", "--frames", "1", "--fps", "60", "--jobs", "1"]
    assert main(["benchmark", "tables", walk, walk, *words, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == 1


def test_recordings_of_the_same_name_have_a_table_and_a_plot_each(
    walk, tmp_path: Path, capsys
) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra [plots])")
    copy = tmp_path / "copy" / "walk"
    shutil.copytree(walk, copy)
    words = ["--preset", "tuned", "--seeds", "1", "--frames", "1", "--fps", "60", "--jobs", "1"]
    out = tmp_path / "out"
    assert main(["benchmark", "tables", walk, str(copy), *words, "-o", str(out)]) == 0
    shown = capsys.readouterr().out
    assert f"{walk}, 1 seed" in shown and f"{copy}, 1 seed" in shown
    found = sorted(path.name for path in (out / "plots").iterdir())
    assert found == ["walk_60fps.png", "walk_60fps_2.png"]


def test_a_stature_is_refused_where_every_start_is_given(walk, capsys) -> None:
    assert main(["benchmark", "live", walk, "--stature", "1.7"]) == 1
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "--stature is given for starts with ground_truth.trc" in last


def test_a_papers_table_with_its_figures_beside_ours(walk, tmp_path: Path, capsys) -> None:
    words = [
        "tables", walk, "--table", "sppso_2,sppso_ablation", "--seeds", "1", "--frames", "1",
        "--fps", "60", "--jobs", "1", "--truth-score", "-o", str(tmp_path),
    ]  # fmt: skip
    assert main(["benchmark", *words]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "SPPSO, Table 2" in shown and "theirs:" in shown and "Lee walk" in shown
    assert "38, max 86.4" in shown and "ACIVS 2012" in shown and "f truth-result" in shown
    assert "sppso.stages=global" in shown and "partition=hard" in shown
    table = json.loads((tmp_path / "table.json").read_text())
    # The published row is in both tables and runs once.
    assert [row["evaluations"] for row in table["rows"]] == [1000, 2000, 4000] + [1000] * 4
    assert len(list((tmp_path / "runs").iterdir())) == 7
    assert [paper["table"] for paper in table["papers"]] == ["sppso_2", "sppso_ablation"]
    assert table["configurations"][5]["partition"] == "hard"
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[5]["variant"] == "partition=hard" and float(rows[5]["ms_per_evaluation"]) > 0


def test_plots_are_written_beside_the_table(walk, tmp_path: Path, capsys) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra [plots])")
    words = [
        "tables", walk, "--preset", "paper", "--vary", "partition=soft,hard", "--vary",
        "prediction=0.5", "--vary", "sigma.scale=0.4", "--seeds", "1",
        "--frames", "4", "--jobs", "1", "-o", str(tmp_path),
    ]  # fmt: skip
    assert main(["benchmark", *words]) == 0
    out = capsys.readouterr().out
    assert (
        "variant" in out
        and "partition=hard" in out
        and "prediction" not in out
        and "sigma" not in out
    )
    found = sorted(path.name for path in (tmp_path / "plots").iterdir())
    assert found == ["walk_20fps.png", "walk_60fps.png"]


def test_without_matplotlib_the_table_is_complete(walk, tmp_path, capsys, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    words = ["tables", walk, "--preset", "paper", "--seeds", "1", "--frames", "1", "--fps", "60"]
    assert main(["benchmark", *words, "--jobs", "1", "-o", str(tmp_path)]) == 0
    assert "warning: plots: matplotlib is not installed" in capsys.readouterr().err
    assert (tmp_path / "table.json").is_file() and not (tmp_path / "plots").exists()


def test_a_cluster_without_dask_says_what_is_missing(walk, capsys, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ["tables", walk, "--seeds", "1", "--frames", "1", "--scheduler", "tcp://here:8786"]
    assert main(["benchmark", *words]) == 1
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "scheduler tcp://here:8786" in last and "[cluster]" in last


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
        "view_evaluation_us": {
            "full": 6.6, "limb": 2.2, "limb_soft": 4.4, "person31": 9.9, "reference": 198.0,
        },
        "reference_ratio": 30.0, "person31_ratio": 1.5, "limb_ratio": 0.33,
        "limb_soft_ratio": 0.66, "swarm_ms": {"sppso_1000": spread},
        "swarm_ratio": {"hmcpso_3600": 3.21},
        "refine_ms": 0.345, "refine_setup_ms": 4.0, "thousand_evaluations_ms": spread,
        "frame_ms": dict.fromkeys(
            ("background", "edges", "imaging", "fitness", "total"), spread
        ),
        "fit_vs_1000_evaluations": 0.5,
    }  # fmt: skip
    Console(width=100).print(speed_table(figures))
    out = capsys.readouterr().out
    assert "hmcpso_3600 / sppso_1000" in out and "3.21" in out
    assert "198.0" in out and "0.345" in out and "1.25" in out


@pytest.mark.parametrize(
    ("words", "said", "status"),
    [
        ([], "required: {tables,speed", 2),
        (["tables"], "required: SOURCE", 2),
        (["tables", "x", "--seeds", "0"], "expected a whole number from 1", 2),
        (["tables", "x", "--fps", "60,,20"], "expected values with commas", 2),
        (["tables", "x", "--fps", "0"], "expected a number above 0", 2),
        (["tables", "x", "--start-noise", "nan"], "expected a number from 0", 2),
        (["tables", "x", "--vary", "partition"], "expected KEY=VALUE,VALUE...", 2),
        (["tables", "x", "--vary", "a={"], "a value cannot be read", 2),
        (["tables", "x", "--vary", "a=" + "[" * 5000], "a value cannot be read", 2),
        (["tables", "x", "--vary", "partitions=soft"], "did you mean 'partition'?", 1),
        (["tables", "x", "--vary", "apf.layer=5"], "did you mean 'apf.layers'?", 1),
        (["tables", "x", "--vary", "body=a", "--vary", "body=b"], "body is given twice", 1),
        (["tables", "x", "--vary", "seed=1,2"], "seed is given, but every row has the seeds", 1),
        (["tables", "x", "--vary", "threads=1,2"], "threads is given, but every run has one", 1),
        (
            ["tables", "x", "--body", "person31", "--vary", "body=balan31"],
            "body is given by --body, too, expected one of them",
            1,
        ),
        (["silhouettes", "--scale", "0.5"], "--scale is given without a SOURCE", 1),
        (["speed", "--scale", "0.5"], "--scale is given without a SOURCE", 1),
        (["cameras", "x", "--start", "measured", "--stature", "1.7"], "--start automatic", 1),
        (["tables", "x", "--table", "hmcpso_1"], "table 'hmcpso_1' is unknown", 1),
        (["tables", "x", "--table", "all", "--optimizer", "apf"], "does not go with", 1),
        (["tables", "nowhere"], "nowhere: no such file or folder", 1),
        (["tables", "nowhere", "--preset", "best"], "preset is 'best'", 1),
        (["tables", "nowhere", "--refinement", "magic"], "refinement: got 'magic'", 1),
        (["speed", "nowhere"], "nowhere: no such file or folder", 1),
        (["speed", "--threads", "-1", "--frames", "1"], "threads: got -1", 1),
    ],
)
def test_errors_are_one_line(words, said, status, capsys) -> None:
    try:
        code = main(["benchmark", *words])
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    assert code == status and not captured.out
    last = captured.err.strip().splitlines()[-1]
    assert said in last and "Traceback" not in captured.err


def test_silhouettes_of_a_recording(walk, tmp_path: Path, capsys) -> None:
    words = ["silhouettes", walk, "--pictures", str(tmp_path), "--json"]
    assert main(["benchmark", *words]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["exact"] and figures["frames"] == [0]
    assert figures["iou_mean"] > 0.8 and set(figures["opencv"]) == {"mog2", "knn"}
    assert len(list(tmp_path.glob("walk-cam*-000000.png"))) == 3
    assert main(["benchmark", "silhouettes", walk, walk]) == 0
    assert capsys.readouterr().out.count("OpenCV MOG2") == 2


def test_automatic_starts(walk, capsys) -> None:
    words = ["start", walk, "--stature", "1.72", "--every", "2", "--frames", "2", "--threads", "1"]
    assert main(["benchmark", *words, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["count"] == len(row["starts"]) == 2 and row["found"] == 1.0
    assert [start["frame"] for start in row["starts"]] == [0, 2]
    assert row["succeeded"] == 1.0 and row["wrong_heading"] == 0.0


def test_values_for_each_recording(walk, capsys) -> None:
    assert main(["benchmark", "start", walk, "--stature", "1.72,1.8"]) == 1
    assert "--stature: 2 values for 1 recordings" in capsys.readouterr().err


def test_a_recording_shorter_than_every_disturbance_is_an_error(walk, capsys) -> None:
    words = ["recovery", walk, "--stature", "1.72", "--seeds", "1", "--threads", "1", "--json"]
    assert main(["benchmark", *words]) == 1
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "4 frames, expected 5 or more with a truth after the first 81" in last


def test_fewer_cameras(walk, capsys) -> None:
    words = ["cameras", walk, "--each", "2", "--start", "measured", "--threads", "1"]
    assert main(["benchmark", *words, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert [len(run["cameras"]) for run in row["runs"]] == [3, 2, 2, 2]
    assert main(["benchmark", *words]) == 0
    out = capsys.readouterr().out
    assert "cam01 cam03" in out and "measured, 2 cameras" in out
    assert main(["benchmark", "cameras", walk, "--start", "guessed"]) == 1
    assert "--start: got guessed, expected some of measured, automatic" in capsys.readouterr().err


def test_jitter_of_too_few_frames_is_an_error(walk, capsys) -> None:
    assert main(["benchmark", "jitter", walk, "--threads", "1"]) == 1
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "tracked for 4 frames in a row" in last and "expected 32 frames" in last
