"""docs/faults.md names tests that exist, once in each line of its tables."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
ROWS = [
    line
    for line in PAGE.splitlines()
    if line.startswith("| ") and not line.startswith(("| fault", "|---"))
]
NAMED = re.findall(r"`([\w/]+\.py)::(\w+)`", PAGE)


def test_every_fault_has_a_reaction_and_a_test() -> None:
    assert len(ROWS) >= 35
    for row in ROWS:
        fault, reaction, test = (cell.strip() for cell in row.strip("|").split(" | "))
        assert fault and reaction and re.search(r"`[\w/]+\.py::test_\w+`", test), row


def test_what_is_long_is_marked_and_nothing_else() -> None:
    for row in ROWS:
        for file, name in re.findall(r"`([\w/]+\.py)::(\w+)`", row):
            assert not is_long(file, name) or "*long*" in row, row


def functions(file: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse((ROOT / "test" / file).read_text(encoding="utf-8"))
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}


def is_long(file: str, name: str) -> bool:
    return any(ast.unparse(d) == "pytest.mark.long" for d in functions(file)[name].decorator_list)


@pytest.mark.parametrize(("file", "name"), sorted(set(NAMED)))
def test_the_named_test_exists(file: str, name: str) -> None:
    assert name in functions(file)
