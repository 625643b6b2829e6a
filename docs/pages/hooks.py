"""Owns what mkdocs does beyond its plugins: pages that stand at the top of the repository, and their links."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
# Files beside docs/, by the page that each becomes.
TOP = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
_PAGE_OF = {source: page for page, source in TOP.items()}
_LINK = re.compile(r"(\]\()([^)#\s:]+)(#[^)\s]*)?(\))")


def on_files(files: Files, *, config: Any) -> Files:
    """Add the pages that stand beside docs/, their links as they are from within it."""
    for page, source in TOP.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_LINK.sub(_from_top, text)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links out of docs/ lead to the pages that these files become."""
    return _LINK.sub(_from_docs, markdown)


def _from_top(match: re.Match[str]) -> str:
    before, target, anchor, after = match.groups()
    return f"{before}{_PAGE_OF.get(target, target.removeprefix('docs/'))}{anchor or ''}{after}"


def _from_docs(match: re.Match[str]) -> str:
    before, target, anchor, after = match.groups()
    name = target.removeprefix("../")
    return f"{before}{_PAGE_OF.get(name, target) if name != target else target}{anchor or ''}{after}"
