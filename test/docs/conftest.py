"""The Markdown files of the repository, their links and their code."""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
_FENCED = re.compile(r"^(`{3,})(\w*)\n(.*?)^\1", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:^    .*\n)+", re.MULTILINE)


@dataclass(frozen=True)
class MarkdownFile:
    """A Markdown file.

    Attributes:
        path: relative to the repository.
    """

    path: Path

    @cached_property
    def text(self) -> str:
        return (ROOT / self.path).read_text(encoding="utf-8")

    @cached_property
    def prose(self) -> str:
        """The text without its blocks of code."""
        return _FENCED.sub("", self.text)

    @property
    def links(self) -> list[str]:
        """Targets of the links and pictures that are no address on the web."""
        found = re.findall(r"\]\(([^)\s]+)\)", self.prose)
        return [link for link in found if not link.startswith(("http:", "https:"))]

    @property
    def anchors(self) -> set[str]:
        """Anchors of the headings, as sites of repositories and MkDocs make them."""
        heads = re.findall(r"^#+ (.*)$", self.prose, re.MULTILINE)
        plain = (re.sub(r"[^\w\- ]", "", head.replace("`", "")).lower() for head in heads)
        return {head.strip().replace(" ", "-") for head in plain}

    @property
    def lines_of_code(self) -> list[str]:
        """Lines of the blocks of code, continued ones joined, without comments of the shell."""
        blocks = [body for _, kind, body in _FENCED.findall(self.text) if kind in ("", "bash")]
        blocks += _INDENTED.findall(self.prose)
        lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
        return [re.sub(r"\s+# .*", "", line).strip() for line in lines]

    @property
    def spans_of_code(self) -> list[str]:
        """Code within sentences."""
        return [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", self.prose)]


MARKDOWN = [
    MarkdownFile(path.relative_to(ROOT))
    for folder in (".", "docs", "bench", "bags")
    for path in sorted((ROOT / folder).glob("*.md"))
]


@pytest.fixture(params=MARKDOWN, ids=lambda file: file.path.as_posix())
def markdown(request: pytest.FixtureRequest) -> MarkdownFile:
    """Every Markdown file, one after another."""
    return request.param
