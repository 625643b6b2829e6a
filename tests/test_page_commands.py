"""Every bash block of the pages runs, at a scale that tests can afford, or is listed with a reason."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from page_commands import LISTED, PAGES, TABLES, Done, bash_blocks, listed, run_blocks, run_pages

from benchmarks.pages import blocks

FENCE = re.compile(r"^\s*(?:```|~~~)", re.M)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Done]:
    """What became of the blocks of each page."""
    return run_pages(tmp_path_factory.mktemp("pages"))


@pytest.mark.parametrize("page", [page for page in PAGES if bash_blocks(page)])
def test_bash_blocks_run(page: str, pages: dict[str, Done]):
    assert not pages[page].failed, pages[page].failed
    assert pages[page].commands


def test_every_block_is_code_that_tests_run_or_an_output():
    for page, path in PAGES.items():
        text = path.read_text(encoding="utf-8")
        found = blocks(text)
        assert 2 * len(found) == len(FENCE.findall(text)), f"{page}: a fence that is not seen as a block"
        assert {block.language for block in found} <= {"bash", "python", "text", "json"}, page


def test_no_entry_of_the_tables_is_left_over(pages: dict[str, Done]):
    found = [block for path in PAGES.values() for block in blocks(path.read_text(encoding="utf-8"))]
    assert {listed(block) for block in found} - {None} == set(LISTED)
    commands = [command for done in pages.values() for command in done.commands]
    for name, table in TABLES.items():
        assert {command["used"][name] for command in commands} - {None} == set(table), name


def test_all_commands_of_a_page_are_carried_out(pages: dict[str, Done]):
    commands = [" ".join(command["words"]) for command in pages["docs/measurements/gallery.md"].commands]
    assert commands == [block.text.strip() for block in bash_blocks("docs/measurements/gallery.md")]
    assert all((Path(__file__).parents[1] / "scenes" / f"{line.split()[-1]}.py").exists() for line in commands)


def test_blocks_share_a_folder_and_the_first_that_fails_is_told(tmp_path: Path):
    (folder := tmp_path / "page").mkdir()
    done = run_blocks(["echo one > a\n", "cat a\nfalse | cat\ntouch b\n", "touch c\n"], folder, tmp_path)
    assert done.failed.startswith("exit status 1: cat a") and "\none\n" in done.failed
    assert [path.name for path in folder.iterdir()] == ["a"]
    assert "127" in run_blocks(["warp-mca scenes\n"], folder, tmp_path).failed
