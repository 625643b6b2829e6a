"""What users read stays short: words of all pages but API, generated tables and changelog, without code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
APART = ("docs/api/", "docs/measurements/", "docs/warnings.md", "CHANGELOG.md")  # for developers, or generated
CODE = re.compile(r"^```.*?^```$", re.S | re.M)
FORMULA = re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.S)


def words(page: Path) -> int:
    """Words of a page outside its code blocks; a formula is one word."""
    return len(FORMULA.sub("formula", CODE.sub("", page.read_text(encoding="utf-8"))).split())


def pages() -> list[Path]:
    """The pages that users read."""
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    return [page for page in found if not str(page.relative_to(ROOT)).startswith(APART)]


def test_formulas_and_code_are_not_read_word_by_word(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("With $a = b$:\n\n$$c\n= d$$\n\n```bash\none two\n```\n", encoding="utf-8")
    assert words(page) == 3


def test_what_users_read_is_short():
    assert sum(map(words, pages())) <= 25_000


@pytest.mark.parametrize(("name", "limit"), [("README.md", 1_400), ("docs/accuracy.md", 1_800)])
def test_pages_with_a_limit_of_their_own(name: str, limit: int):
    assert len((ROOT / name).read_text(encoding="utf-8").split()) <= limit


def test_decisions_take_half_a_page_each():
    assert sum(map(words, (ROOT / "docs" / "decisions").glob("*.md"))) <= 5_000


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "measurements").glob("*.md")), ids=lambda page: page.stem)
def test_measurements_say_their_date(page: Path):
    assert page.name.endswith(".template.md") or re.search(r"\b20\d\d-\d\d-\d\d\b", page.read_text(encoding="utf-8"))
