"""The documentation site builds without warnings, all its links lead somewhere, and it needs no network to be read."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

pytest.importorskip("mkdocs", reason="the extra docs is not installed")
pytest.importorskip("mkdocstrings")
pytest.importorskip("latex2mathml")
pytest.importorskip("pandas")

ROOT = Path(__file__).resolve().parents[1]
LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}  # by a browser, unasked


class Page(HTMLParser):
    """Links, places that links may name, and what a browser loads with a page."""

    def __init__(self, text: str) -> None:
        """Read a page."""
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep what an element refers to."""
        values = {name: value or "" for name, value in attrs}
        self.places |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag in LOADED and LOADED[tag] in values:
            self.loaded.append(values[LOADED[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    path = os.pathsep.join([str(ROOT), *sys.path])
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    """Every page, by its file."""
    return {path: Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}


def test_links_lead_somewhere(site: Path, pages: dict[Path, Page]):
    missing = []
    for path, page in pages.items():
        if path.name == "404.html":  # its links count from the server's top
            continue
        for link in {*page.links, *page.loaded}:
            if re.match(r"[a-z]+:", link):
                continue
            target, place = urldefrag(unquote(link))
            file = (path.parent / target).resolve() if target else path
            known = file in pages and (not place or place in pages[file].places or place == "__codelineno-0-1")
            if not (known if file.suffix == ".html" else file.exists()):
                missing.append((str(path.relative_to(site)), link))
    assert missing == []
    assert len(pages) > 50


def test_nothing_is_loaded_from_the_network(site: Path, pages: dict[Path, Page]):
    assert [item for page in pages.values() for item in page.loaded if item.startswith(("http:", "https:", "//"))] == []
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.search(r"(@import|url\()\s*['\"]?(https?:)?//", styles)
    assert not any("mermaid" in page.places for page in pages.values())


def test_the_notebook_was_run(site: Path):
    text = (site / "tutorials" / "study.html").read_text(encoding="utf-8")
    assert "mass on spring [N]</th>" in text and "runs and closed form differ by" in text
    assert list((site / "tutorials").glob("study-*.png"))


def test_formulas_are_set_without_scripts(site: Path):
    text = (site / "theory.html").read_text(encoding="utf-8")
    assert text.count('<div class="formula"><math') > 30 and text.count("<math") > 200
    assert "arithmatex" not in text and not re.search(r"<p>[^<]*\$", text)
    formulas = "".join(re.findall(r"<math.*?</math>", text, re.S))
    assert "\\" not in formulas and "merror" not in formulas
