"""The papers' tables: shipped rows can run, errors in a file name the place."""

import pytest

from markerless_tracker.benchmarks.tables.papers import choose, read_papers
from markerless_tracker.errors import ConfigError
from markerless_tracker.tracking import TrackerConfig

SHIPPED = read_papers()


@pytest.mark.parametrize("name", SHIPPED)
def test_every_row_can_run_as_published(name) -> None:
    table = SHIPPED[name]
    configs = [TrackerConfig.from_mapping({"preset": "paper", **r.settings}) for r in table.rows]
    assert len(set(configs)) == len(configs)
    assert {config.refinement for config in configs} == {"none"}
    assert set(table.rates) <= {60.0, 20.0} and table.title and table.source


def test_evaluations_are_those_of_the_papers() -> None:
    """To the unit: 1000, 2000, 4000; 3600, 7200, 10800."""

    def counts(name: str) -> list[int]:
        rows = SHIPPED[name].rows
        return [
            TrackerConfig.from_mapping({"preset": "paper", **row.settings}).evaluations
            for row in rows
        ]

    assert counts("sppso_2") == [1000, 2000, 4000]
    assert counts("sppso_apf") == [1000, 1000]
    assert counts("hmcpso_3") == [3600, 7200, 10800]
    for name in ("hmcpso_2", "hmcpso_4", "hmcpso_5", "hmcpso_6", "hmcpso_spread"):
        assert set(counts(name)) == {3600}


def test_figures_as_the_papers_print_them() -> None:
    first = SHIPPED["sppso_2"].rows[0].theirs
    assert first == {"Lee walk": {"mean_mm": 38.0, "max_mm": 86.4}}
    assert SHIPPED["hmcpso_2"].recordings == tuple(
        f"{subject} {motion}" for subject in ("S2", "S4") for motion in ("walk", "jog", "balance")
    )
    # The same row of three tables, and time per frame against time per evaluation.
    ours = [SHIPPED[name].rows[at].theirs for name, at in (("hmcpso_3", 0), ("hmcpso_4", 2))]
    assert ours[0] == ours[1] == SHIPPED["hmcpso_5"].rows[-1].theirs
    for row in SHIPPED["hmcpso_6"].rows:
        figures = row.theirs["HumanEva-II"]
        assert figures["ms_per_evaluation"] == pytest.approx(
            figures["s_per_frame"] / 3.6,
            rel=0.001 if row.settings["optimizer"] != "mcpso" else 0.02,
        )


def test_tables_by_name() -> None:
    assert [table.name for table in choose(SHIPPED, ["hmcpso_5", "all"])][0] == "hmcpso_5"
    assert len(choose(SHIPPED, ["hmcpso_5", "all"])) == len(SHIPPED)
    with pytest.raises(ConfigError, match="table 'hmcpso_9' is unknown, expected all or sppso_2"):
        choose(SHIPPED, ["hmcpso_9"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tables: [", "cannot be read"),
        ("[]", "no tables of papers"),
        (
            "papers: {a: b}\ntables: {t: {title: T, paper: a, fps: [60], rows: "
            "[{settings: {}, theirs: {walk: {mean: 1}}}]}}",
            "t: row 1: walk: mean: got 1, expected a number of mean_mm",
        ),
        (
            "papers: {a: b}\ntables: {t: {title: T, paper: c, fps: [60], rows: []}}",
            "KeyError 'c'",
        ),
    ],
)
def test_a_malformed_file_is_named(tmp_path, text, said) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        read_papers(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
