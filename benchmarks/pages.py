"""Owns what the pages of the documentation print and picture: runs their code blocks, in the order in which they stand.

    python -m benchmarks.pages                          run every page of PAGES, write its outputs and pictures
    python -m benchmarks.pages tutorials/drop.md        one of them

A Python block is run; one with `title="NAME"` is written to the file NAME instead, beside the page's other files. A
block of ```text that follows a Python block shows what that one printed. `![…](…/images/pages/NAME.png)` shows the
picture NAME.png that the page's code wrote. `tests/test_pages.py` runs the pages as well, and compares.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import logging
import os
import re
import shutil
import sys
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.pictures import shrink

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = DOCS / "images" / "pages"
PAGES = (
    "tutorials/drop.md",
    "tutorials/arm.md",
    "tutorials/study.ipynb",
    "tutorials/material.md",
    "how-to/materials.md",
    "how-to/rubber.md",
    "how-to/damping.md",
    "how-to/joints.md",
    "how-to/failure.md",
    "how-to/rigid_plane.md",
    "how-to/boundary.md",
    "how-to/loads.md",
    "how-to/robots.md",
    "how-to/units.md",
    "how-to/stopped.md",
)
_BLOCK = re.compile(r"^```(?P<info>[^\n`]+)\n(?P<text>.*?)^```$", re.S | re.M)
_PICTURE = re.compile(r"!\[[^\]]*\]\([./]*images/pages/([^)]+)\)")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page.

    Attributes:
        language: python, bash, text, …
        title: of the file that it stands for; empty if it stands for none.
        text: what it holds.
        start, end: where the text stands in the page.
    """

    language: str
    title: str
    text: str
    start: int
    end: int


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page in Markdown."""
    found = []
    for match in _BLOCK.finditer(text):
        language, _, rest = match["info"].partition(" ")
        title = re.search(r'title="([^"]+)"', rest)
        found.append(Block(language, title[1] if title else "", match["text"], match.start("text"), match.end("text")))
    return found


def page_blocks(page: str) -> list[Block]:
    """The blocks of a page, by its place in docs/; the code cells of a notebook are its Python blocks."""
    text = (DOCS / page).read_text(encoding="utf-8")
    if not page.endswith(".ipynb"):
        return blocks(text)
    cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    return [Block("python", "", "".join(cell["source"]), 0, 0) for cell in cells]


def run_page(page: str, folder: Path, given: dict[str, object] | None = None) -> list[tuple[Block, str]]:
    """Run the Python blocks of a page in a folder, each going on from the one before: what each one printed.

    Bash blocks are not run. Raises whatever a block raises.

    Args:
        page: its place in docs/.
        folder: to run in.
        given: names that the page takes as known.
    """
    before, path = Path.cwd(), list(sys.path)
    names: dict[str, object] = {"__name__": "__main__", **(given or {})}
    printed, loaded = [], set(sys.modules)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    try:
        for number, block in enumerate(item for item in page_blocks(page) if item.language == "python"):
            out = io.StringIO()
            if block.title:
                Path(block.title).write_text(block.text, encoding="utf-8")
            else:
                with contextlib.redirect_stdout(out):
                    exec(compile(block.text, f"docs/{page}, block {number + 1}", "exec"), names)
            printed.append((block, out.getvalue()))
    finally:
        os.chdir(before)
        sys.path[:] = path
        for name in set(sys.modules) - loaded:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                del sys.modules[name]
    return printed


def shown(page: str) -> list[tuple[Block, Block]]:
    """The Python blocks of a page whose output it shows, each with the block that shows it."""
    if page.endswith(".ipynb"):
        return []
    text = (DOCS / page).read_text(encoding="utf-8")
    return [
        (code, output)
        for code, output in pairwise(blocks(text))
        if (code.language, output.language, text[code.end : output.start].split())
        == ("python", "text", ["```", "```text"])
    ]


def pictures(page: str) -> list[str]:
    """Names of the pictures that a page shows of its own runs."""
    return _PICTURE.findall((DOCS / page).read_text(encoding="utf-8"))


def write(page: str, folder: Path) -> None:
    """Run a page, and put what it printed and drew where the page shows it."""
    printed = {block.start: re.sub(r" +$", "", text, flags=re.M) for block, text in run_page(page, folder)}
    text = (DOCS / page).read_text(encoding="utf-8")
    for code, output in reversed(shown(page)):
        text = text[: output.start] + printed[code.start] + text[output.end :]
    if not page.endswith(".ipynb"):
        (DOCS / page).write_text(text, encoding="utf-8")
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in pictures(page):
        shutil.copy(folder / name, PICTURES / name)
        shrink(PICTURES / name)


def main() -> None:
    """Read the command line and do what it asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", help="which, from docs/ on; all without a name")
    asked = parser.parse_args()
    logging.disable(logging.INFO)
    for page in asked.pages or PAGES:
        with tempfile.TemporaryDirectory() as folder:
            write(page, Path(folder))
        print(page, flush=True)


if __name__ == "__main__":
    main()
