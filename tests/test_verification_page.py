"""verification.md and mutations.json say what the code says, of every case, element and precision."""

from __future__ import annotations

import json
import re

import pytest

from benchmarks.deliberate import CATCHES, MUTATIONS, notes
from benchmarks.measurements import FOLDER
from benchmarks.verification import key, measure, tasks, write_page
from warp_mca.verify import cases

PAGE = (FOLDER / "verification.md").read_text(encoding="utf-8")
CASES = cases()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_page_has_each_case(case):
    section = PAGE.split(f"### {case.name}\n", 1)[1].split("\n## ", 1)[0].split("\n### ", 1)[0]
    assert f"{case.title}. {case.reference}" in section
    assert notes()[case.name] in section
    assert case.elements or "| none | mixed" in section
    for element in case.elements:
        for precision in ("mixed", "float64"):
            assert re.search(rf"\| {element} \| [\w, ]*\b{precision}\b", section), (element, precision)
    assert "Tolerances: " in section


def test_every_case_was_seen_to_fail():
    rows = json.loads((FOLDER / "mutations.json").read_text(encoding="utf-8"))
    ran = {(row["error"], row["case"]): row for row in rows}
    assert set(ran) == {(name, case.name) for case in CASES for name in CATCHES[case.name]}
    assert {case for _, case in ran} == {case.name for case in CASES}
    for (name, _), row in ran.items():
        assert row["failed"], row
        assert (row["what"], row["element"]) == (MUTATIONS[name].what, MUTATIONS[name].element), name
        assert f"Warp {row['warp']}" in PAGE


def test_page_says_at_its_head_whether_every_row_is_met():
    missed = any(line.endswith(("| NOT MET |", "| OPEN |")) for line in PAGE.splitlines())
    assert ("Every row is met." in PAGE) != missed


def test_page_is_written_from_what_was_stored(tmp_path):
    stored = json.loads((FOLDER / "verification.json").read_text(encoding="utf-8"))
    write_page(stored, tmp_path)
    assert (tmp_path / "verification.md").read_text(encoding="utf-8") == PAGE
    assert {key(found) for found in stored} == {task[:3] for task in tasks((), "", "")}


def test_an_outcome_is_stored_as_it_is_read(tmp_path, capsys):
    found = measure(("patch_test", "tet4", "mixed", "cpu", "quick"))
    assert found is not None
    write_page(json.loads(json.dumps([found])), tmp_path)
    page = (tmp_path / "verification.md").read_text(encoding="utf-8")
    assert page.count("| tet4 | mixed | ") == len(found["rows"]) > 1
    assert "| NOT MET |" not in page
    assert "patch_test (tet4, mixed)" in capsys.readouterr().out
