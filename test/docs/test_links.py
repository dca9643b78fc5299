"""Links between files: targets and anchors exist; the site shows every page and public name."""

import re
from pathlib import Path

import yaml

import markerless_tracker


def test_links_and_anchors_exist(markdown, project_root: Path) -> None:
    wrong = []
    for link in markdown.links:
        name, _, anchor = link.partition("#")
        path = markdown.path.parent / name if name else markdown.path
        if not (project_root / path).exists():
            wrong.append(f"{link}: no such file")
        elif anchor and anchor not in type(markdown)(path).anchors:
            wrong.append(f"{link}: no such heading")
    assert wrong == []


def test_files_named_in_sentences_exist(markdown, project_root: Path) -> None:
    named = [
        span
        for span in markdown.spans_of_code
        if re.fullmatch(r"(?:docs|config|test|examples|launch|bench|bags)/[\w./-]+\.\w+", span)
    ]
    assert [name for name in named if not (project_root / name).is_file()] == []


def test_the_code_names_pages_that_exist(project_root: Path) -> None:
    named = {
        page
        for path in (project_root / "markerless_tracker").rglob("*.py")
        for page in re.findall(r"docs/[\w-]+\.md", path.read_text(encoding="utf-8"))
    }
    assert "docs/joint-angles.md" in named
    assert sorted(page for page in named if not (project_root / page).is_file()) == []


def test_every_page_is_in_the_sites_navigation(project_root: Path) -> None:
    text = (project_root / "mkdocs.yml").read_text(encoding="utf-8")
    listed = re.findall(r": ([\w./-]+\.md)$", text, re.MULTILINE)
    pages = {path.name for path in (project_root / "docs").glob("*.md")}
    assert {name for name in listed if "/" not in name} == {*pages, "index.md"}
    outside = [name.removeprefix("repository/") for name in listed if "/" in name]
    assert [name for name in outside if not (project_root / name).is_file()] == []


def test_the_api_page_has_the_public_names(project_root: Path) -> None:
    text = (project_root / "docs" / "api.md").read_text(encoding="utf-8")
    shown = re.findall(r"^::: markerless_tracker\.(\w+)$", text, re.MULTILINE)
    assert sorted(shown) == sorted(set(markerless_tracker.__all__) - {"__version__"})


def test_the_published_figures_are_those_of_the_settings(project_root: Path) -> None:
    text = (project_root / "docs" / "papers.md").read_text(encoding="utf-8")
    papers = yaml.safe_load((project_root / "config" / "papers.yaml").read_text(encoding="utf-8"))
    tables = papers["tables"]
    assert set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)) == set(tables)
    rows = {row.split("|")[1].strip(): row for row in text.splitlines() if row.startswith("|")}
    for row in tables["sppso_2"]["rows"]:
        theirs = row["theirs"]["Lee walk"]
        shown = rows[str(row["settings"]["evaluations"])].split("|")[2:4]
        assert [float(cell) for cell in shown] == [theirs["mean_mm"], theirs["max_mm"]]
    for row in tables["hmcpso_5"]["rows"]:
        name = row["settings"]["optimizer"].upper().replace("HMCPSO", "H-MCPSO")
        theirs = [f"{v['mean_mm']} ± {v['sd_mm']}" for v in row["theirs"].values()]
        assert [cell.strip() for cell in rows[name].split("|")[2:5]] == theirs


def test_troubleshooting_quotes_messages_of_the_code(project_root: Path) -> None:
    text = (project_root / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    source = " ".join(
        re.sub(r'"\s*\n\s*f?"', "", path.read_text(encoding="utf-8"))
        for path in (project_root / "markerless_tracker").rglob("*.py")
    )
    first = re.findall(r"^\| ([^|]*) \|", text, re.MULTILINE)
    quotes = [q for cell in first for q in re.findall(r"`([a-z][^`]* [^`]*)`", cell)]
    known = [q for q in quotes if not re.search(r"cam0|--", q)]
    assert len(known) > 8
    assert [quote for quote in known if quote not in source] == []
