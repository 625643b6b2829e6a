"""docs/theory.md names places in the code that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")


def test_every_section_of_methods_names_files_that_exist():
    """A line has folders and files; a bare file name stands in the folder of the place before it."""
    sections = re.findall(r"^## (?!Problem)(.*?)\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M)
    assert len(sections) > 20
    for title, text in sections:
        (line,) = re.findall(r"^\*In the code:\* (.*?)\.$", text, re.S | re.M)
        folder = ROOT
        for name in re.findall(r"`([^`]+)`", line):
            if name.isidentifier():  # a function of the file before
                assert f"def {name}(" in folder.read_text(encoding="utf-8"), (title, name)
                continue
            place = ROOT / name if "/" in name else (folder if folder.is_dir() else folder.parent) / name
            assert place.exists(), (title, name)
            folder = place
