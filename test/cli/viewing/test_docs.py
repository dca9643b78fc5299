"""The commands of docs/report.md, on a result of our own."""

import re
import shlex
from pathlib import Path

import pytest

from markerless_tracker.cli.main import main


def test_the_commands_of_the_page_run(
    tracked: Path, walk: Path, project_root: Path, tmp_path: Path, monkeypatch, capsys
) -> None:
    pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    text = (project_root / "docs" / "report.md").read_text(encoding="utf-8")
    commands = re.findall(r"^markerless_tracker ((?:view|report) .*)$", text, re.MULTILINE)
    assert len(commands) == 2
    monkeypatch.chdir(tmp_path)
    for command in commands:
        words = shlex.split(
            command.replace("out/walk", str(tracked)).replace("recordings/walk", str(walk))
        )
        assert main(words) == 0, capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"walk.webm", "walk.png", "walk.html"}
    for option in re.findall(r"(?<=`)--[a-z-]+", text):
        helped = ""
        for verb in ("view", "report", "track", "evaluate"):
            with pytest.raises(SystemExit):
                main([verb, "--help"])
            helped += capsys.readouterr().out
        assert option in helped
