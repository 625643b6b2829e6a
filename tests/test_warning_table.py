"""Each guard, warning and piece of advice is told where its condition holds, and not where it just does not."""

from __future__ import annotations

import re

import pytest
from warning_pairs import PAIRS
from watched import pattern

from benchmarks.warnings import PAGE, page
from warp_mca.watch.row import Row
from warp_mca.watch.table import TABLE


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.name)
@pytest.mark.filterwarnings("ignore:overflow")
def test_each_row_is_told_beyond_its_limit_and_not_just_within(row: Row):
    found = PAIRS[row.name]
    assert any(re.fullmatch(pattern(row), text) for text in found(True))
    assert not any(re.fullmatch(pattern(row), text) for text in found(False))


def test_names_of_rows_are_their_own():
    assert len({row.name for row in TABLE}) == len(TABLE)
    assert set(PAIRS) == {row.name for row in TABLE}
    assert all(row.found.__doc__ and (row.unit or not row.limit) for row in TABLE)


def test_the_page_of_warnings_is_written_from_the_table():
    assert PAGE.read_text(encoding="utf-8") == page()
