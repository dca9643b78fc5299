"""Commands in the Markdown files: verbs, options, targets, executables and parameters exist."""

import argparse
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from markerless_tracker.cli.main import PROGRAM, VERBS, parser_of

EXECUTABLES = {"tracker", "player", "segmenter"}
"""Entry points of the nodes (setup.py)."""
parser = cache(parser_of)


def options(of: argparse.ArgumentParser) -> Iterator[str]:
    """All options of a parser and of its kinds."""
    for action in of._actions:
        yield from action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            for kind in action.choices.values():
                yield from options(kind)


def complaint(words: list[str]) -> str:
    """What is wrong with the arguments of the command; empty if nothing is."""
    if not words or words[0] in ("VERB", "--help", "--version"):
        return ""
    if words[0] not in VERBS:
        return f"no verb {words[0]}"
    if any(word.startswith("[") for word in words):  # a synopsis
        named = re.findall(r"--[a-z][\w-]*", " ".join(words))
        unknown = set(named) - set(options(parser(words[0])))
        return f"{words[0]} has no {', '.join(unknown)}" if unknown else ""
    try:
        parser(words[0]).parse_args(words[1:])
    except SystemExit as error:
        return "" if error.code == 0 else f"{' '.join(words)} is refused"
    return ""


def test_commands_are_accepted_by_the_parsers(markdown, capsys) -> None:
    wrong = []
    for line in markdown.lines_of_code:
        for command in re.split(r"&&|;", line):
            words = shlex.split(command) if PROGRAM in command else []
            if words[:1] == [PROGRAM]:
                wrong.append(complaint(words[1:]))
    assert [text for text in wrong if text] == [], capsys.readouterr().err


def test_options_in_sentences_exist(markdown) -> None:
    wrong = []
    for span in markdown.spans_of_code:
        words = span.removeprefix(f"{PROGRAM} ").split()
        if words[0] not in VERBS or words[0] == span:
            continue
        known = set(options(parser(words[0])))
        wrong += [f"{span}: {word}" for word in words[1:]
                  if word.startswith("--") and word.partition("=")[0] not in known]  # fmt: skip
    assert wrong == []


def test_the_page_on_offline_use_lists_every_verb(project_root: Path) -> None:
    text = (project_root / "docs" / "offline.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)) == set(VERBS)


def test_targets_of_make_exist(markdown, project_root: Path) -> None:
    made = set(re.findall(r"^([\w-]+):", (project_root / "Makefile").read_text(), re.MULTILINE))
    named = [
        word
        for line in [*markdown.lines_of_code, *markdown.spans_of_code]
        for word in re.findall(r"^make ([a-z-]+)", line)
    ]
    assert set(named) <= made


def test_parameters_of_the_nodes_exist(markdown, project_root: Path) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    from markerless_tracker.node.player.parameters import descriptions
    from markerless_tracker.node.segmenter.parameters import known_parameters
    from markerless_tracker.node.tracker.parameters import parameter_names

    known = {
        "tracker": set(parameter_names()),
        "player": set(descriptions()),
        "segmenter": set(known_parameters()),
    }
    launch = "".join(path.read_text() for path in (project_root / "launch").glob("*.xml"))
    arguments = set(re.findall(r'<arg name="(\w+)"', launch))
    wrong = []
    for line in markdown.lines_of_code:
        run = re.match(r"(?:ros2 run markerless_tracker )?(\w+) --ros-args", line)
        if run:
            given = set(re.findall(r"-p ([\w.]+):=", line))
            wrong += [f"{run[1]}: {name}" for name in given - known.get(run[1], set())]
        elif line.startswith("ros2 launch markerless_tracker"):
            wrong += [f"launch: {n}" for n in set(re.findall(r"(\w+):=", line)) - arguments]
    assert wrong == []
    for name in re.findall(r"ros2 run markerless_tracker (\w+)", markdown.text):
        assert name in EXECUTABLES


def test_the_tests_see_the_commands(markdown) -> None:
    if markdown.path.name in ("README.md", "own-cameras.md", "report.md", "offline.md"):
        assert any(line.startswith((PROGRAM, "make ")) for line in markdown.lines_of_code)
