"""Verb `evaluate` on references of other laboratories: names, worlds, clocks, C3D."""

import json
from pathlib import Path

import numpy as np
import pytest

from markerless_tracker.cli.main import main
from markerless_tracker.datasets import MarkerTrack, write_trc
from markerless_tracker.geometry import rotation_from_rodrigues

OURS = ("Pelvis", "Neck", "LShoulder", "LElbow", "LWrist", "RHip", "RKnee")
ROTATION = rotation_from_rodrigues([0.2, -0.4, 1.1])
SHIFT_M = np.array([1.5, -2.0, 0.4])


def swing(times_s: np.ndarray) -> np.ndarray:
    """(n, 7, 3) markers that move smoothly and not all alike."""
    rng = np.random.default_rng(2)
    base, size, rate = (
        rng.normal(0.0, 0.5, (7, 3)),
        rng.normal(0.0, 0.2, (7, 3)),
        rng.random((7, 3)),
    )
    return base + size * np.sin(2.0 + (3.0 + 4.0 * rate) * times_s[:, None, None])


def write(path: Path, names, stamps_ns, positions_m) -> str:
    write_trc(path, MarkerTrack(names, stamps_ns, positions_m), 60.0)
    return str(path)


@pytest.fixture
def found(tmp_path: Path) -> str:
    stamps = np.round(np.arange(120) * 1e9 / 60).astype(np.int64)
    return write(tmp_path / "found.trc", OURS, stamps, swing(stamps / 1e9))


def figures(capsys, *words: str) -> dict:
    assert main(["evaluate", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_known_set_of_names(found, tmp_path: Path, capsys) -> None:
    stamps = np.round(np.arange(120) * 1e9 / 60).astype(np.int64)
    own = swing(stamps / 1e9)
    wrist, knee = own[:, 4], own[:, 6]
    names = ("PELO", "LSJC", "LEJC", "LWRA", "LWRB", "RHJC", "RFEO", "LFHD")
    columns = [own[:, 0], own[:, 2], own[:, 3], wrist + 0.03, wrist - 0.03, own[:, 5], knee, knee]
    other = write(tmp_path / "pig.trc", names, stamps, np.stack(columns, axis=1))
    assert main(["evaluate", found, other]) == 1
    error = capsys.readouterr().err
    assert "no common marker" in error and "--markers names a set" in error
    summary = figures(capsys, found, other, "--markers", "plugin-gait")
    assert summary["mean_mm"] == pytest.approx(0.0, abs=0.01)
    assert sorted(summary["joints"]) == sorted(set(OURS) - {"Neck"})
    assert summary["not_compared"] == {"result": ["Neck"], "reference": ["LFHD"]}
    assert main(["evaluate", found, other, "--markers", "plugin-gait"]) == 0
    out = capsys.readouterr().out
    assert "not compared: LFHD of the reference" in out
    assert "not compared: Neck of the result" in out


def test_a_map_of_ones_own(found, tmp_path: Path, capsys) -> None:
    stamps = np.array([0, 16_666_667])
    own = swing(stamps / 1e9)
    other = write(tmp_path / "lab.trc", ("a", "b", "c"), stamps, own[:, [4, 4, 1]] + 0.0)
    table = tmp_path / "map.yaml"
    table.write_text("LWrist: [a, b]\nNeck: c\n", encoding="utf-8")
    summary = figures(capsys, found, other, "--markers", str(table))
    assert sorted(summary["joints"]) == ["LWrist", "Neck"]
    assert summary["mean_mm"] == pytest.approx(0.0, abs=0.01)
    for text, reported in (
        ("LWrist: 3\n", "map.yaml: LWrist: 3, expected a marker's name"),
        ("- a\n", "map.yaml: expected a mapping of markers, got list"),
        ("[" * 5000, "map.yaml: cannot be read: maximum recursion"),
        ("LWrist: other\n", "lab.trc: no marker of the map: expected some of other"),
    ):
        table.write_text(text, encoding="utf-8")
        assert main(["evaluate", found, other, "--markers", str(table)]) == 1
        error = capsys.readouterr().err
        assert reported in error and error.count("\n") == 1
    assert main(["evaluate", found, other, "--markers", "vicon"]) == 1
    assert (
        "marker set 'vicon' is unknown, expected pose2sim, plugin-gait" in capsys.readouterr().err
    )


@pytest.mark.parametrize(("offset_s", "rate"), [(0.3541, 60.0), (-0.2, 100.0), (1000.25, 60.0)])
def test_worlds_and_clocks_are_aligned(found, tmp_path, capsys, offset_s, rate) -> None:
    times = np.arange(int(3.0 * rate)) / rate - 0.5
    stamps = np.round((times + offset_s + 2.0 * (offset_s < 0)) * 1e9).astype(np.int64)
    shown = swing(times) @ ROTATION.T + SHIFT_M
    other = write(tmp_path / "other.trc", OURS, stamps, shown)
    summary = figures(capsys, found, other, "--align")
    aligned = summary["alignment"]
    assert summary["mean_mm"] < 1.0 and summary["frames"] == 120
    assert summary["reference_frames"] == len(stamps)
    expected = offset_s + 2.0 * (offset_s < 0)
    skipped = figures(capsys, found, other, "--align", "--skip", "60")
    rest = np.count_nonzero(stamps / 1e9 > 1.0 + expected - 0.002)
    assert skipped["frames"] == 60 and abs(skipped["reference_frames"] - rest) <= 1
    assert aligned["time_offset_s"] == pytest.approx(expected, abs=0.001)
    np.testing.assert_allclose(aligned["rotation"], ROTATION, atol=0.001)
    np.testing.assert_allclose(aligned["translation_mm"], 1000.0 * SHIFT_M, atol=1.0)
    assert main(["evaluate", found, other, "--align"]) == 0
    out = capsys.readouterr().out
    assert "aligned: rotation 68.03 degrees" in out
    assert f"rms distance {aligned['rms_mm']:.1f} mm" in out
    assert f"120 frames of the result compared; the reference has {len(stamps)}" in out


def test_alignment_removes_no_error_of_single_frames(found, tmp_path: Path, capsys) -> None:
    """One transform for all frames: errors that change from frame to frame remain."""
    stamps = np.round(np.arange(120) * 1e9 / 60).astype(np.int64)
    wrong = swing(stamps / 1e9) + 0.05 * np.where(np.arange(120) % 2, 1.0, -1.0)[:, None, None]
    other = write(tmp_path / "other.trc", OURS, stamps, wrong)
    summary = figures(capsys, found, other, "--align")
    assert summary["mean_mm"] > 50.0
    assert main(["evaluate", found, found, other, "--align"]) == 0
    assert "found.trc: aligned: " in capsys.readouterr().out


def test_measures_of_the_field(tmp_path: Path, capsys) -> None:
    names = ("Pelvis", "Neck", "LWrist")
    truth = np.array([[[0.0, 0.0, 1.0], [0.0, 0.0, 1.5], [0.3, 0.2, 1.2]]] * 2)
    stamps = np.array([0, 16_666_667])
    # Everything 0.5 m ahead, twice as large about the pelvis, and once turned by a right angle.
    wrong = (truth - truth[:, :1]) * 2.0 + truth[:, :1] + [0.5, 0.0, 0.0]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    wrong[1] = (wrong[1] - wrong[1, 0]) @ turn.T + wrong[1, 0]
    one = write(tmp_path / "a.trc", names, stamps, wrong)
    other = write(tmp_path / "b.trc", names, stamps, truth)
    summary = figures(capsys, one, other)
    arm = truth[0, 2] - truth[0, 0]
    errors = [0.0, 500.0, np.linalg.norm(arm) * 1000.0]
    second = [0.0, 500.0, np.linalg.norm(2.0 * turn @ arm - arm) * 1000.0]
    assert summary["mpjpe_mm"] == pytest.approx(np.mean([*errors, *second]), abs=0.01)
    assert summary["pa_mpjpe_mm"] == pytest.approx(0.0, abs=0.01)
    assert summary["pck"] == pytest.approx(1 / 3)


def test_a_reference_in_c3d(tmp_path: Path, found, capsys) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    times = np.arange(120) / 60.0
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [60]
    content["parameters"]["POINT"]["LABELS"]["value"] = [*OURS, "extra"]
    points = np.ones((4, 8, 120))
    points[:3, :7] = swing(times).transpose(2, 1, 0) * 1000.0
    content["data"]["points"] = points
    path = tmp_path / "lab.c3d"
    content.write(str(path))
    summary = figures(capsys, found, str(path))
    assert summary["frames"] == 120 and summary["mean_mm"] < 0.01
    assert summary["not_compared"]["reference"] == ["extra"]
    assert main(["evaluate", found, str(tmp_path / "none.c3d")]) == 1
    assert "none.c3d: cannot be read" in capsys.readouterr().err
    (tmp_path / "broken.c3d").write_bytes(b"no c3d")
    assert main(["evaluate", found, str(tmp_path / "broken.c3d")]) == 1
    assert "broken.c3d: cannot be read as C3D" in capsys.readouterr().err


def test_headings_are_those_of_an_upright_world(tmp_path: Path, capsys) -> None:
    """Where one of both worlds lies on its side, the other's gives the heading frame."""
    stamps = np.round(np.arange(60) * 1e9 / 60).astype(np.int64)
    names = ("LShoulder", "RShoulder", "LHip", "RHip", "Head", "LWrist")
    stand = np.array([
        [0.0, 0.2, 1.4], [0.0, -0.2, 1.4], [0.0, 0.1, 0.9], [0.0, -0.1, 0.9], [0.0, 0.0, 1.7],
        [0.1, 0.3, 0.8],
    ])  # fmt: skip
    moved = stand + 0.3 * np.sin(4.0 * stamps / 1e9)[:, None, None] * [1.0, 0.5, 0.1]
    moved[:, 5, 2] += 0.1 * np.sin(9.0 * stamps / 1e9)
    off = moved.copy()
    off[:, 4, 0] += 0.02
    own = write(tmp_path / "own.trc", names, stamps, off)
    # As this tracker writes it.
    (tmp_path / "own.json").write_text(json.dumps({"frames": []}), encoding="utf-8")
    other = write(tmp_path / "other.trc", names, stamps, off[:, :, [1, 2, 0]])
    lying = write(tmp_path / "lying.trc", names, stamps, moved[:, :, [1, 2, 0]])
    upright = write(tmp_path / "upright.trc", names, stamps, moved)
    expected = figures(capsys, own, upright, "--align")
    for words in ((own, lying), (other, upright)):
        found = figures(capsys, *words, "--align")
        assert found["mean_mm"] == pytest.approx(expected["mean_mm"], abs=0.01)
        for joint, bias in expected["bias"].items():
            assert found["bias"][joint] == pytest.approx(bias, abs=0.2), joint
    assert expected["bias"]["Head"][0] > 5.0
