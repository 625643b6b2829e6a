"""The pages of the documentation: their code runs, prints what they show, and their commands exist."""

from __future__ import annotations

import argparse
import json
import re
import shlex
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from PIL import Image

import warp_mca as mca
from benchmarks.gallery import render, run_scene
from benchmarks.gallery_scenes import SCENES
from benchmarks.measurements import FOLDER
from benchmarks.pages import DOCS, PAGES, blocks, page_blocks, pictures, run_page, shown
from benchmarks.pictures import WIDTH
from warp_mca.cli.parser import make_parser
from warp_mca.scene.catalogue import load_source, parse_overrides, scene_names

ROOT = DOCS.parent
NUMBER = re.compile(r"[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Figures are drawn to files, and closed."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    import matplotlib.pyplot as plt

    yield
    plt.close("all")


def same(printed: str, page: str) -> bool:
    """Whether two texts agree but for numbers in the last of three digits, as another processor rounds."""
    a, b = (NUMBER.sub("#", text).split() for text in (printed, page))
    numbers = ([float(n.replace(",", "")) for n in NUMBER.findall(text)] for text in (printed, page))
    return a == b and all(x == pytest.approx(y, rel=0.02, abs=1e-3) for x, y in zip(*numbers, strict=True))


def test_all_pages_of_tutorials_and_how_tos_are_listed():
    found = {str(path.relative_to(DOCS)) for name in ("tutorials", "how-to") for path in (DOCS / name).iterdir()}
    assert found == set(PAGES)


def test_notebooks_are_stored_without_outputs():
    for path in DOCS.rglob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells), path.name


@pytest.mark.parametrize("page", PAGES)
def test_page_runs_and_prints_what_it_shows(page: str, tmp_path: Path):
    if page.endswith(".ipynb"):
        pytest.importorskip("pandas")
    printed = {block.start: text for block, text in run_page(page, tmp_path)}
    for code, output in shown(page):
        assert same(printed[code.start], output.text), printed[code.start]
    for name in pictures(page):
        with Image.open(DOCS / "images" / "pages" / name) as picture:
            assert len(picture.convert("RGB").getcolors(100_000) or ()) > 3
        assert (tmp_path / name).exists()


def test_a_difference_in_what_a_page_prints_is_found():
    assert same("peak 1820 N, 3.1e-4\n", "peak 1821 N, 3.1e-4\n")
    assert not same("peak 1820 N", "peak 1900 N")
    assert not same("peak 1820 N", "top 1820 N")


def test_the_material_of_the_tutorial_is_that_of_the_tests():
    (law,) = [block for block in page_blocks("tutorials/material.md") if block.title == "voce.py"]
    assert law.text == (ROOT / "tests" / "voce.py").read_text(encoding="utf-8")


def test_the_gallery_has_every_scene_and_is_rendered_from_its_runs():
    rows = json.loads((FOLDER / "gallery.json").read_text(encoding="utf-8"))
    assert (FOLDER / "gallery.md").read_text(encoding="utf-8") == render(rows)
    assert sorted(row["scene"] for row in rows) == sorted(SCENES) == sorted(scene_names())
    for row in rows:
        with Image.open(FOLDER / "images" / "gallery" / f"{row['scene']}.png") as picture:
            assert picture.width <= WIDTH
        if row["known"] is not None:
            assert row["measured"] == pytest.approx(row["known"], rel=0.03, abs=1e-12), row["scene"]


def test_a_run_gives_the_figure_of_the_gallery(tmp_path: Path):
    rows = {row["scene"]: row for row in json.loads((FOLDER / "gallery.json").read_text(encoding="utf-8"))}
    assert run_scene("pulse_bar", tmp_path)["measured"] == pytest.approx(rows["pulse_bar"]["measured"], rel=1e-4)


def test_every_public_name_is_in_the_api():
    text = "".join(path.read_text(encoding="utf-8") for path in (DOCS / "api").glob("*.md"))
    names = re.findall(r"^::: warp_mca\.(\w+)$", text, flags=re.M)
    assert sorted(names) == sorted(set(mca.__all__) - {"__version__"})


def command_lines(page: Path) -> list[str]:
    """Lines of a page's bash blocks, those that go on joined, parts of `a && b` by themselves, without comments."""
    text = "\n".join(b.text for b in blocks(page.read_text(encoding="utf-8")) if b.language == "bash")
    lines = [shlex.join(shlex.split(line, comments=True)) for line in text.replace("\\\n", " ").splitlines()]
    return [part.strip() for line in lines for part in line.replace("'&&'", "&&").split("&&") if part.strip()]


COMMANDS = [
    (page.name, line)
    for page in [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
    if not page.name.endswith(".template.md")
    for line in command_lines(page)
]


def test_commands_on_the_pages_are_accepted():
    """Options exist, and so do scenes, presets and parameters; modules of benchmarks can be imported."""
    seen = 0
    for page, line in COMMANDS:
        words = shlex.split(line)
        if words[0] == "warp-mca" and "NAME" not in line:
            words = words[1 : words.index(">")] if ">" in words else words[1:]
            asked = make_parser().parse_args(words)
            check_scene(asked, f"{page}: {line}")
            seen += 1
        elif words[:2] == ["python", "-m"] and words[2].startswith("benchmarks"):
            assert import_module(words[2] + ".__main__" if words[2] == "benchmarks" else words[2]).main
    assert seen > 60


def check_scene(asked: argparse.Namespace, where: str) -> None:
    """That a built-in scene of a command exists and takes its parameters."""
    name = getattr(asked, "scene", None)
    if isinstance(name, str) and "." not in name and name != "SCENE":
        assert name in scene_names(), where
        load_source(name).resolve(
            getattr(asked, "preset", None), parse_overrides(getattr(asked, "settings", None) or ())
        )
