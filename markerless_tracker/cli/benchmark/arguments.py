"""The parser of a kind of benchmark."""

import argparse
import textwrap
from typing import Any

from markerless_tracker.cli.main import HELP_WIDTH


def add_kind(
    kinds: "argparse._SubParsersAction[Any]", name: str, *examples: str, help: str, description: str
) -> argparse.ArgumentParser:
    """A parser of one kind of benchmark.

    Args:
        kinds: receives the parser.
        name: name of the kind.
        examples: lines below the help, printed verbatim.
        help: one line in the list of kinds.
        description: beginning of the help.
    """
    parser: argparse.ArgumentParser = kinds.add_parser(
        name,
        help=help,
        description=textwrap.fill(description, HELP_WIDTH),
        epilog="\n  ".join(("example:" if len(examples) == 1 else "examples:", *examples)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    return parser
