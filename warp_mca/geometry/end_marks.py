"""Owns what is looked for in mesh files of other programs before they are read: marks at their end, blank fields, cells
that the reader passes over."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

_LAST = {".bdf": "ENDDATA", ".nas": "ENDDATA", ".k": "*END", ".key": "*END", ".dyn": "*END"}
_SOLIDS = ("CHEXA", "CPENTA", "CPYRA", "CPYRAM", "CTETRA")
_FLAT = ("CBAR", "CBEAM", "CONROD", "CQUAD4", "CQUAD8", "CROD", "CTRIA3", "CTRIA6")
END_REQUIRED = (".unv", ".bdf", ".nas")  # the others may do without


def missing_end(path: Path) -> str | None:
    """What a file lacks at its end, in words; None where it lacks nothing, or its format has no such mark."""
    suffix = path.suffix.lower()
    if suffix == ".unv":
        with path.open(errors="replace") as lines:
            marks = sum(line.strip() == "-1" for line in lines)  # before and after each of its sections
        return "the -1 after its last section" if marks % 2 else None
    last = _LAST.get(suffix)
    if last is None:
        return None
    with path.open(errors="replace") as lines:
        return None if any(line.upper().startswith(last) for line in lines) else last


def _nastran_lines(path: Path) -> Iterator[tuple[str, str]]:
    """Each line of a Nastran file with the name of its card in capitals; none of other files."""
    if path.suffix.lower() in (".bdf", ".nas"):
        with path.open(errors="replace") as lines:
            for line in lines:
                yield line[:8].split(",")[0].strip(" *\n").upper(), line


def cell_without_property(path: Path) -> str | None:
    """Number of the first cell of a Nastran file whose property field is blank; None where there is none.

    gmsh leaves blank fields out, so that all nodes of the cell would move up by one.
    """
    for card, line in _nastran_lines(path):
        if card in _SOLIDS:
            width = 16 if "*" in line[:8] else 8
            fields = line.split(",")[1:3] if "," in line else [line[8 : 8 + width], line[8 + width : 8 + 2 * width]]
            if len(fields) < 2 or not fields[1].strip():
                return fields[0].strip()
    return None


def unread_cells(path: Path) -> dict[str, int]:
    """Cards of a Nastran file that have the name of a cell, and that gmsh does not know: how many of each."""
    found: Counter[str] = Counter()
    for card, _ in _nastran_lines(path):
        if card == "BEGIN BU":  # other cards come before it
            found.clear()
        if card.startswith("C") and not card.startswith("CORD") and card not in (*_SOLIDS, *_FLAT):
            found[card] += 1
    return dict(found)
