"""Owns what mkdocs does beyond its plugins: files beside docs/, links that leave docs/, notebooks, formulas."""

from __future__ import annotations

import posixpath
import re
import textwrap
from html import unescape
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from notebooks import render  # beside this file: mkdocs looks there for what hooks import

ROOT = Path(__file__).resolve().parents[2]
# Pages of files beside docs/, by where these stand in the repository.
PAGE_OF = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
CITATION = "CITATION.cff"
CODE = ("kernels/", "scenes/", "tests/", "benchmarks/", "warp_mca/")  # shown as pages of their own where linked
_LINK = re.compile(r"(?P<before>\]\()(?P<target>[^)#\s:]+)(?P<anchor>#[^)\s]*)?(?P<after>\))")
# A formula as pymdownx.arithmatex leaves it: in a span within a line, in a div of its own.
_FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.S)
_BOLD_DIGIT = re.compile(r'<mn mathvariant="bold">(\d)</mn>')


def on_files(files: Files, *, config: Any) -> Files:
    """Add pages of files beside docs/, of notebooks, which run now, and of each source file that a page links to."""
    for notebook in [file for file in files if file.src_uri.endswith(".ipynb")]:
        text, pictures = render(Path(str(notebook.abs_src_path)))
        files.append(File.generated(config, notebook.src_uri.removesuffix(".ipynb") + ".md", content=text))
        for name, picture in pictures.items():
            place = posixpath.join(posixpath.dirname(notebook.src_uri), name)
            files.append(File.generated(config, place, content=picture))
    for source, page in PAGE_OF.items():
        text = _relinked((ROOT / source).read_text(encoding="utf-8"), source, page)
        files.append(File.generated(config, page, content=text))
    files.append(File.generated(config, CITATION, content=(ROOT / CITATION).read_text(encoding="utf-8")))
    sources = set()
    for file in files.documentation_pages():
        place = "docs/" + file.src_uri
        text = file.content_string if file.generated_by else Path(str(file.abs_src_path)).read_text(encoding="utf-8")
        sources |= {found for match in _LINK.finditer(text) if (found := _from(place, match["target"])).endswith(".py")}
    for source in sorted(sources):
        if source.startswith(CODE) and (ROOT / source).is_file():
            text = (ROOT / source).read_text(encoding="utf-8")
            content = f"# {source}\n\n```python\n{text}```\n"
            page = File.generated(config, _code_page(source), content=content)
            page.inclusion = InclusionLevel.NOT_IN_NAV
            files.append(page)
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: Any) -> str:
    """Links out of docs/ lead to the pages that these files become; the gallery shows the code of its scenes."""
    if page.file.generated_by:
        return markdown
    if page.file.src_uri == "measurements/gallery.md":
        markdown = re.sub(r"Code: \[scenes/(\w+)\.py\]\([^)]*\)\.", _scene_code, markdown)
    return _relinked(markdown, "docs/" + page.file.src_uri, page.file.src_uri)


def on_page_content(html: str, **_: Any) -> str:
    """Formulas between dollar signs become MathML, which browsers set without scripts, fonts or a network."""
    return _FORMULA.sub(_set_formula, html)


def _set_formula(match: re.Match[str]) -> str:
    """The `<math>` element of a formula; one of its own stands in a paragraph of its own."""
    block = match["tag"] == "div"
    math = convert(unescape(match["latex"]).strip(), display="block" if block else "inline")
    math = _BOLD_DIGIT.sub(
        lambda digit: f"<mn>{chr(0x1D7CE + int(digit[1]))}</mn>", math
    )  # browsers ignore mathvariant
    return f'<div class="formula">{math}</div>' if block else math


def _scene_code(match: re.Match[str]) -> str:
    """The link to a scene's file, and what its `build` does, folded."""
    code = (ROOT / "scenes" / f"{match[1]}.py").read_text(encoding="utf-8").split(") -> mca.Scene:\n")[1]
    body = code.split("\n\n\n")[0].rstrip()
    fence = f"```python\n{textwrap.dedent(body)}\n```"
    return f'{match[0]}\n\n??? example "The scene"\n\n{textwrap.indent(fence, "    ")}'


def _code_page(source: str) -> str:
    return f"code/{source.removesuffix('.py')}.md"


def _from(place: str, target: str) -> str:
    """Where a link in the file at `place` leads, from the top of the repository on."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(place), target))


def _relinked(text: str, place: str, page: str) -> str:
    """The text of the file at `place`, with links as they are from the page that it becomes."""

    def relink(match: re.Match[str]) -> str:
        found = _from(place, match["target"])
        if found.startswith("docs/"):
            to = re.sub(r"\.ipynb$", ".md", found.removeprefix("docs/"))
        elif found == CITATION:
            to = found
        elif found in PAGE_OF:
            to = PAGE_OF[found]
        elif found.startswith(CODE) and found.endswith(".py"):
            to = _code_page(found)
        else:
            return match[0]
        to = posixpath.relpath(to, posixpath.dirname(page) or ".")
        return f"{match['before']}{to}{match['anchor'] or ''}{match['after']}"

    return _LINK.sub(relink, text)
