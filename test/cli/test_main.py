"""The command line: overview, dispatch, errors, exit statuses."""

import argparse
import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from markerless_tracker import __version__
from markerless_tracker.cli import main as cli
from markerless_tracker.errors import ConfigError

Install = Callable[[Callable[[argparse.Namespace], int]], None]


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Installs a verb `probe` whose `run` is the given function."""

    def install(run: Callable[[argparse.Namespace], int]) -> None:
        def add_arguments(parser: argparse.ArgumentParser) -> None:
            parser.add_argument("source", help="what to read")
            parser.add_argument("--count", type=int, default=1)

        module = SimpleNamespace(
            HELP="Probe a source.",
            EXAMPLE="markerless_tracker probe here --count 2",
            add_arguments=add_arguments,
            run=run,
        )
        monkeypatch.setitem(sys.modules, "markerless_tracker.cli.probe", module)
        monkeypatch.setattr(cli, "VERBS", {**cli.VERBS, "probe": "a probe"})

    return install


def raising(error: BaseException) -> Callable[[argparse.Namespace], int]:
    def run(args: argparse.Namespace) -> int:
        raise error

    return run


def test_overview_lists_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    out = capsys.readouterr().out
    for name, text in cli.VERBS.items():
        assert f"  {name}" in out
        assert text in out
    assert [line for line in out.splitlines() if line[80:]] == []


def test_without_a_verb_the_overview_is_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "verbs:" in captured.err


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"markerless_tracker {__version__}\n"


def test_unknown_verb_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["trakc"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "'trakc'" in err
    assert "track" in err


def test_arguments_are_passed_to_the_verb(verb: Install) -> None:
    seen = []

    def run(args: argparse.Namespace) -> int:
        seen.append((args.source, args.count))
        return 3

    verb(run)
    assert cli.main(["probe", "here", "--count", "7"]) == 3
    assert seen == [("here", 7)]


def test_wrong_argument_is_one_line(verb: Install, capsys: pytest.CaptureFixture[str]) -> None:
    verb(lambda args: 0)
    with pytest.raises(SystemExit) as stop:
        cli.main(["probe", "here", "--count", "many"])
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "--count" in err
    assert "many" in err


def test_help_of_a_verb_has_its_example(verb: Install, capsys: pytest.CaptureFixture[str]) -> None:
    verb(lambda args: 0)
    with pytest.raises(SystemExit) as stop:
        cli.main(["probe", "--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert "Probe a source." in out
    assert "markerless_tracker probe here --count 2" in out


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (
            ConfigError("setting 'speed': got -1, expected > 0"),
            "setting 'speed': got -1, expected > 0",
        ),
        (ConfigError("two\nlines"), "two lines"),
        (
            FileNotFoundError(2, "No such file or directory", "a/b.toml"),
            "a/b.toml: No such file or directory",
        ),
        (OSError("disk on fire"), "disk on fire"),
    ],
)
def test_an_error_is_one_line(
    verb: Install, capsys: pytest.CaptureFixture[str], error: Exception, line: str
) -> None:
    verb(raising(error))
    assert cli.main(["probe", "here"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"markerless_tracker: error: {line}\n"


def test_a_programming_error_is_not_hidden(verb: Install) -> None:
    verb(raising(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli.main(["probe", "here"])


def test_an_interrupt_prints_nothing(verb: Install, capsys: pytest.CaptureFixture[str]) -> None:
    verb(raising(KeyboardInterrupt()))
    assert cli.main(["probe", "here"]) == 130
    assert capsys.readouterr() == ("", "")


def test_help_imports_no_numerical_library() -> None:
    code = (
        "import sys; from markerless_tracker.cli.main import main; main(['--help']); "
        "print(sorted({'numpy', 'cv2', 'numba', 'scipy', 'rclpy', 'rosbags'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("word", ["probe", "--help", "--version"])
def test_a_closed_pipe_is_no_error(word: str) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    code = (
        "import sys, types; from markerless_tracker.cli import main as m\n"
        "def run(args):\n"
        "    for _ in range(10000): print('many lines')\n"
        "    return 0\n"
        "probe = types.SimpleNamespace(HELP='h', EXAMPLE='e', run=run)\n"
        "probe.add_arguments = lambda parser: None\n"
        "sys.modules['markerless_tracker.cli.probe'] = probe; m.VERBS = {'probe': ''}\n"
        f"sys.exit(m.main([{word!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=write_end, stderr=subprocess.PIPE, text=True
    )
    os.close(write_end)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("content", [b"", b"I am a text"])
def test_a_file_that_is_no_video_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "board").mkdir()
    (tmp_path / "board" / "cam01.mp4").write_bytes(content)
    words = ["calibrate", "board", "-o", "out.toml"]
    done = subprocess.run(
        [sys.executable, "-m", "markerless_tracker", *words],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and "cam01.mp4: cannot be read as a video" in line
    assert line.endswith(f"({len(content)} bytes)")


def test_module_runs_as_a_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "markerless_tracker", "nonsense"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "unknown verb 'nonsense'" in done.stderr


def test_a_mistyped_verb_is_told_the_nearest_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["trak", "walk"]) == 2
    assert "unknown verb 'trak', did you mean track?" in capsys.readouterr().err


@pytest.mark.parametrize("name", sorted(cli.VERBS))
def test_each_verb_has_help_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    module = importlib.import_module(f"markerless_tracker.cli.{name}")
    assert module.EXAMPLE.startswith(f"markerless_tracker {name}")
    assert "\n\n" not in module.EXAMPLE
    with pytest.raises(SystemExit) as stop:
        cli.main([name, "--help"])
    assert stop.value.code == 0
    assert module.EXAMPLE in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("compile", "search algorithms, some of sppso"),
        ("doctor", "listened to (default 3)"),
        ("track", "seed of all random draws (default 0)"),
    ],
)
def test_help_names_defaults(name: str, expected: str) -> None:
    assert expected in " ".join(cli.parser_of(name).format_help().split())


@pytest.mark.parametrize("name", ["", ".", "..", "out/"])
@pytest.mark.parametrize(
    "words", [["track", "walk", "-o"], ["view"], ["report", "-o", "page.html"], ["export"]]
)
def test_a_folder_is_no_name_of_a_result(
    words: list[str], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([*words, name])
    assert ended.value.code == 2
    assert f"{name!r} names no file, expected a name such as" in capsys.readouterr().err
