"""Hook of MkDocs: README.md as the first page, linked files outside docs/ as further pages.

Pages in docs/ link to files of the repository (../config/tracker.yaml, ../bench/README.md) as they
lie there, so that the links hold in the repository and in an editor. In the site a linked Markdown
file is a page, any other text file a page with its text.
"""

import re
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
FIRST = "README.md"
"""The first page."""
ALWAYS = (
    "CONTRIBUTING.md", "CHANGELOG.md", "QUALITY_DECLARATION.md", "bench/README.md",
    "bench/choices.md", "bags/README.md",
)  # fmt: skip
"""Pages of the navigation that lie outside docs/."""
LANGUAGES = {".py": "python", ".yaml": "yaml", ".xml": "xml", ".json": "json"}
LINK = re.compile(r"(?<=\]\()(?!https?:|#)([^)#\s]+)")
"""Target of a relative link, without its anchor."""
FENCED = re.compile(r"^(`{3,}).*?^\1", re.MULTILINE | re.DOTALL)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add a page for the first page, and for every linked file outside docs/."""
    waiting = [FIRST, *ALWAYS]
    waiting += [f"docs/{file.src_uri}" for file in files.documentation_pages()]
    seen: set[str] = set()
    while waiting:
        path = waiting.pop(0)
        if path in seen or not (ROOT / path).is_file():
            continue
        seen.add(path)
        if PurePosixPath(path).suffix == ".md":
            text = (ROOT / path).read_text(encoding="utf-8")
            waiting += [_target(link, path) for link in LINK.findall(FENCED.sub("", text))]
        if not path.startswith("docs/"):
            files.append(File.generated(config, _uri(path), content=_content(path)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links between pages."""
    path = _path(page.file.src_uri)
    if not path.endswith(".md"):
        return markdown

    def moved(link: re.Match[str]) -> str:
        target = _target(link[1], path)
        if not (ROOT / target).is_file():
            return link[1]  # reported by MkDocs
        return relpath(_uri(target), PurePosixPath(page.file.src_uri).parent.as_posix())

    parts, at = [], 0
    for block in FENCED.finditer(markdown):
        parts += [LINK.sub(moved, markdown[at : block.start()]), block[0]]
        at = block.end()
    return "".join([*parts, LINK.sub(moved, markdown[at:])])


def _target(link: str, path: str) -> str:
    """Path in the repository of a link in the file `path`; of a folder, that of its first page."""
    target = normpath(f"{PurePosixPath(path).parent}/{link}")
    if target == "docs":
        return FIRST
    page = f"{target}/README.md"
    return page if (ROOT / page).is_file() else target


def _uri(path: str) -> str:
    """Source of the page for a file of the repository, relative to docs/."""
    if path == FIRST:
        return "index.md"
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    return f"repository/{path}" + ("" if path.endswith(".md") else ".md")


def _path(uri: str) -> str:
    """File of the repository that a page shows."""
    if uri == "index.md":
        return FIRST
    if not uri.startswith("repository/"):
        return f"docs/{uri}"
    path = uri.removeprefix("repository/")
    return path if (ROOT / path).is_file() else path.removesuffix(".md")


def _content(path: str) -> str:
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".md"):
        return text
    return f"# {path}\n\n````{LANGUAGES.get(PurePosixPath(path).suffix, 'text')}\n{text}````\n"
