"""Mesh files that were cut off: refused where their format has an end mark, warned of where it may be left out."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.end_marks import cell_without_property, missing_end, unread_cells

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


@pytest.mark.parametrize(
    ("line", "cell"),
    [
        ("CHEXA   1               1       2       5       4       7       8       +11", "1"),
        ("CTETRA,7,,1,2,3,4", "7"),
        ("CTETRA* 12                              1               2", "12"),
        ("CTETRA  12", "12"),
        ("CTETRA  12      1       1       2       3       4", None),
        ("CTETRA,7,3,1,2,3,4", None),
    ],
)
def test_nastran_cells_without_a_property_are_refused(tmp_path: Path, line: str, cell: str | None):
    """Gmsh leaves blank fields out, and would read nodes one field too early."""
    file = tmp_path / "a.bdf"
    file.write_text(f"BEGIN BULK\n{line}\nENDDATA\n")
    assert cell_without_property(file) == cell
    if cell:
        with pytest.raises(RequestError, match=rf"^MeshFile\.path = .*: its cell {cell} has no property number; write"):
            mca.MeshFile(file).build()


def test_cards_that_the_reader_does_not_know_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    """Gmsh passes over them, so that the body has a hole."""
    file = tmp_path / "a.bdf"
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    grid = [f"GRID,{k + 1},,{x}.,{y}.,{z}." for k, (x, y, z) in enumerate(points)]
    cells = ["CTETRA,1,1,1,2,3,4", "CTE5RA,2,1,1,2,3,4", "CTRIA3,3,1,1,2,3"]
    file.write_text("\n".join(["CEND", "BEGIN BULK", "CORD2R,1", *grid, *cells, "ENDDATA", ""]))
    assert unread_cells(file) == {"CTE5RA": 1}
    assert mca.MeshFile(file).build().cell_count == 1
    assert f"{file}: 1 cards CTE5RA are left out" in caplog.text
