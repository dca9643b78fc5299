"""The command ``markerless_tracker VERB``: parses, runs the verb, reports an error in one line.

A verb is a module of this folder with

- ``HELP``: description for its ``--help``;
- ``EXAMPLE``: a command line that uses it;
- ``add_arguments(parser)``;
- ``run(args) -> int``, the exit status.

A verb is imported when it is called, so that ``--help`` is fast.
"""

import argparse
import difflib
import importlib
import os
import sys
import textwrap
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NoReturn

from markerless_tracker import __version__
from markerless_tracker.errors import TrackerError
from markerless_tracker.libraries import keep_freed_memory, quiet_decoders, single_threaded

PROGRAM = "markerless_tracker"

HELP_WIDTH = 78
"""Columns of a verb's description: `--help` fits into a terminal of 80."""

VERBS: Mapping[str, str] = MappingProxyType(
    {
        "calibrate": "calibrate cameras with a checkerboard or ChArUco board",
        "check": "say before tracking what will go wrong with a recording",
        "doctor": "say what is wrong with this machine, its ROS graph and its cameras",
        "convert": "write a recording, dataset or videos as an MCAP bag",
        "track": "track the person in a recording or bag",
        "batch": "track many recordings: results and one summary table",
        "export": "write a result for OpenSim, as C3D, BVH, CSV, NumPy or a bag",
        "record": "record the topics of a running graph to an MCAP bag",
        "evaluate": "compare a result with reference markers, in mm",
        "report": "write an HTML page about a result: film, verdict, angles, gait",
        "view": "show a result over its images: film, picture, Rerun viewer",
        "synthesize": "render a synthetic person, or a board, with the exact truth",
        "benchmark": "measure speed and accuracy",
        "compile": "compile for this machine, so that no first start waits for it",
    }
)
"""Verb -> description in one line."""


class _Parser(argparse.ArgumentParser):
    """Reports a wrong argument in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        argv: the arguments after the program's name; default: those of this process.

    Returns:
        Exit status: 0 done, 1 failed with one line on standard error, 2 wrong arguments,
        3 no person found (`track`, `batch`), a red finding (`check`, `doctor`) or no message
        (`record`, `view --node`), 130 interrupted, 141 standard output was closed by its reader.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    if not words:
        sys.stderr.write(_overview())
        return 2
    verb, rest = words[0], words[1:]
    if verb not in (*VERBS, *_ANSWERS):
        near = difflib.get_close_matches(verb, VERBS, n=1)
        meant = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(VERBS)}"
        sys.stderr.write(f"{PROGRAM}: error: unknown verb {verb!r}, {meant}\n")
        return 2
    try:
        if verb in _ANSWERS:
            sys.stdout.write(_ANSWERS[verb]())
            sys.stdout.flush()
            return 0
        return _run(verb, rest)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Otherwise Python reports the error again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except (TrackerError, OSError) as error:
        sys.stderr.write(f"{PROGRAM}: error: {_line(error)}\n")
        return 1


def parser_of(verb: str) -> argparse.ArgumentParser:
    """The parser of a verb's arguments; a wrong one exits with status 2."""
    module = importlib.import_module(f"markerless_tracker.cli.{verb}")
    parser = _Parser(
        prog=f"{PROGRAM} {verb}",
        description=textwrap.fill(module.HELP, HELP_WIDTH),
        epilog=f"example:\n  {module.EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    return parser


def _run(verb: str, words: Sequence[str]) -> int:
    single_threaded()
    keep_freed_memory()
    quiet_decoders()
    parser = parser_of(verb)
    module = importlib.import_module(f"markerless_tracker.cli.{verb}")
    status = int(module.run(parser.parse_args(words)))
    sys.stdout.flush()
    return status


def _overview() -> str:
    width = max(map(len, VERBS)) + 2
    rows = "".join(f"  {verb:{width}}{text}\n" for verb, text in VERBS.items())
    return (
        f"usage: {PROGRAM} VERB ...\n\n"
        "Full-body pose tracking from several calibrated cameras.\n\n"
        f"verbs:\n{rows}\n"
        f"{PROGRAM} VERB --help describes a verb, with an example.\n"
        f"{PROGRAM} --version prints the version.\n"
    )


def _line(error: Exception) -> str:
    """The error in one line; errors of the operating system name their file first."""
    if isinstance(error, OSError) and error.strerror:
        names = [str(name) for name in (error.filename, error.filename2) if name is not None]
        return ": ".join([*names, error.strerror])
    return " ".join(str(error).split()) or type(error).__name__


def _version() -> str:
    return f"{PROGRAM} {__version__}\n"


_ANSWERS = {"-h": _overview, "--help": _overview, "--version": _version}
"""What stands in the place of a verb, and the text that answers it."""
