"""The tutorials' commands, run one after another as they stand."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIALS = ("own-cameras.md", "offline.md")


@pytest.mark.long
@pytest.mark.parametrize("name", TUTORIALS)
def test_the_commands_of_a_tutorial_run(name: str, project_root: Path, tmp_path: Path) -> None:
    text = (project_root / "docs" / name).read_text(encoding="utf-8")
    blocks = re.findall(r"^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    commands = [block for block in blocks if re.match(r"markerless_tracker |mkdir ", block)]
    assert commands
    program = tmp_path / "bin" / "markerless_tracker"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m markerless_tracker "$@"\n')
    program.chmod(0o755)
    done = subprocess.run(
        ["sh", "-euxc", "".join(commands)],
        cwd=tmp_path,
        env={
            **os.environ,
            "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(project_root),
        },
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "0 lost" in done.stdout
