"""Mesh files that were cut off: refused where their format has an end mark, warned of where it may be left out."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.end_marks import missing_end

K = """*KEYWORD
*NODE
       1             0.0             0.0             0.0
       2             1.0             0.0             0.0
       3             0.0             1.0             0.0
       4             0.0             0.0             1.0
*ELEMENT_SOLID
       1       1       1       2       3       4       4       4       4       4
"""


@pytest.mark.parametrize(
    ("name", "whole", "cut"),
    [
        ("a.unv", "    -1\n  2411\n    -1\n    -1\n  2412\n    -1\n", "    -1\n  2411\n    -1\n    -1\n  2412\n"),
        ("a.bdf", "GRID,1\nEndData\n", "GRID,1\n"),
        ("a.NAS", "GRID,1\nENDDATA", "GRID,1\nEND"),
        ("a.k", K + "*END\n", K),
        ("a.inp", "*NODE\n", None),
    ],
)
def test_files_without_their_end_mark_are_told(tmp_path: Path, name: str, whole: str, cut: str | None):
    file = tmp_path / name
    file.write_text(whole)
    assert missing_end(file) is None
    if cut is not None:
        file.write_text(cut)
        assert missing_end(file)


@pytest.mark.parametrize("name", ["a.unv", "a.bdf"])
def test_a_file_that_was_cut_off_is_refused(tmp_path: Path, name: str):
    file = tmp_path / name
    file.write_text("    -1\n  2411\n")
    with pytest.raises(RequestError, match=r"^MeshFile\.path = .*: it lacks .* cut off; write it again"):
        mca.MeshFile(file).build()


def test_a_keyword_file_without_end_is_read_with_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    file = tmp_path / "a.k"
    for text, warned in ((K + "*END\n", 0), (K, 1)):
        caplog.clear()
        file.write_text(text)
        with caplog.at_level(logging.WARNING, logger="warp_mca"):
            assert len(mca.MeshFile(file).build().points) == 4
        assert sum("lacks *END: if it was cut off" in record.message for record in caplog.records) == warned
