"""How tables are printed: the papers' figures only where they hold."""

import io

import pytest
from rich.console import Console

from markerless_tracker.benchmarks.tables.papers import read_papers
from markerless_tracker.cli.benchmark.layout import full_table, paper_table, printed

ROW = {
    "preset": "paper", "optimizer": "hmcpso", "body": "humaneva34", "refinement": "none",
    "variant": "", "fps": 60.0, "frames": 7, "evaluations": 3600.0, "refinements": 0.0,
    "mean_mm": 44.56, "sd_mm": 2.0, "max_mm": 58.2, "worst_joint_mm": 120.0, "limbs_mm": None,
    "limbs_sd_mm": None, "last_joint_mm": 30.0, "lost_run": 4, "ms_per_evaluation": 0.0625,
    "frames_per_s": 4.0, "truth_difference": None,
}  # fmt: skip


def shown(table) -> str:
    out = io.StringIO()
    Console(file=out, width=250).print(table)
    return out.getvalue()


@pytest.mark.parametrize(
    ("figures", "text"),
    [
        ({}, ""),
        ({"mean_mm": 48, "sd_mm": 4}, "48 ± 4"),
        ({"mean_mm": 38.0, "max_mm": 86.4}, "38, max 86.4"),
        ({"s_per_frame": 120.8, "ms_per_evaluation": 33.55}, "33.55 ms, 120.8 s"),
    ],
)
def test_a_papers_figures_in_a_cell(figures, text) -> None:
    assert printed(figures) == text


def test_a_papers_figures_stand_beside_the_rate_they_hold_for() -> None:
    table = read_papers()["hmcpso_3"]
    rows = [(table.rows[0], {**ROW, "fps": fps}) for fps in (20.0, 60.0)]
    lines = [line for line in shown(
        paper_table("walk", table, rows, truth_score=True)
    ).splitlines() if "hmcpso" in line]  # fmt: skip
    fast, slow = lines
    assert "48 ± 4" in fast and "52 ± 6" in fast and "44.6 ± 2.0" in fast and "0.062" in fast
    assert "48 ± 4" not in slow and "│  20 │" in slow


def test_columns_appear_when_something_differs() -> None:
    table = read_papers()["hmcpso_4"]
    ours = (table.rows[0], ROW)
    plain = shown(paper_table("walk", table, [ours], truth_score=False))
    assert "preset" not in plain and "variant" not in plain and "f truth" not in plain
    both = [ours, (table.rows[0], {**ROW, "preset": "tuned", "variant": "hmcpso.sub_swarms=5"})]
    other = shown(paper_table("walk", table, both, truth_score=True))
    assert "preset" in other and "hmcpso.sub_swarms=5" in other and "f truth-result" in other
    assert "variant" not in shown(full_table("walk", [ROW], truth_score=False))
