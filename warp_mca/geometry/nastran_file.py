"""Owns the reading of Nastran bulk data: grid points, solids by property."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.geometry.deck import Deck, integer, real
from warp_mca.geometry.deck_rules import NASTRAN_RULES

if TYPE_CHECKING:
    import meshio

NASTRAN_SUFFIXES = (".bdf", ".nas", ".fem")
# Corners, nodes at most (gmsh adds some to the 15 of CPENTA), meshio's names of the linear and the quadratic cell.
_SOLIDS = {
    "CTETRA": (4, 10, "tetra", "tetra10"),
    "CPENTA": (6, 18, "wedge", "wedge15"),
    "CHEXA": (8, 27, "hexahedron", "hexahedron20"),
    "CPYRA": (5, 14, "pyramid", "pyramid13"),
    "CPYRAM": (5, 14, "pyramid", "pyramid13"),
}
_MARKS = {"CTRIA3": 3, "CQUAD4": 4, "CTRIA6": 3, "CQUAD8": 4, "CBAR": 2, "CROD": 2}  # of gmsh, corners of each


@dataclass
class _Card:
    """A card: its name without asterisk, the line that it begins in, and its fields after the name."""

    name: str
    line: int
    fields: list[str]
    goes_on: str = ""  # the mark in its last field
    fault: str = ""  # why it cannot be read

    def __getitem__(self, index: int) -> str:
        return self.fields[index] if index < len(self.fields) else ""


def read_nastran(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The solids of a bulk data file, with a cell set "part_N" for each property, and sentences about what is left out.

    Raises:
        ValueError: a card cannot be read, or would change the mesh in a way that is not read.
    """
    deck, systems, first = Deck(path), dict[int, str](), dict[int, int]()
    placed: dict[int, int] = {}  # system of each grid point that names one
    default = 0
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        by_gmsh = "created by gmsh" in file.readline().lower()
    for card in _cards(path):
        try:
            kind = NASTRAN_RULES.kind(card.name)
            if kind == "read" and card.fault:
                raise ValueError(card.fault)
            if card.name == "GRID":
                number = integer(card[0])
                x, y, z = map(real, (card[2], card[3], card[4]))
                deck.add_node(number, (x, y, z))
                first.setdefault(number, card.line)
                if card[1]:
                    placed[number] = integer(card[1])
            elif card.name == "GRDSET":
                default = integer(card[1] or "0")
            elif card.name.startswith("CORD"):
                systems[integer(card[0])] = card.name
                if card.name.startswith("CORD1") and card[4]:
                    systems[integer(card[4])] = card.name
            elif card.name in _SOLIDS:
                _take_solid(deck, card)
            elif by_gmsh and card.name in _MARKS:
                corners = [integer(card[2 + k]) for k in range(_MARKS[card.name])]
                deck.add_face(integer(card[0]), card.name, corners, mark=True)
            elif kind and kind != "read":
                deck.left[kind, card.name] += 1
        except ValueError as error:
            raise ValueError(f"line {card.line}: {error}") from error
    for number in deck.nodes:
        if system := placed.get(number, default):
            name = systems.get(system, "which is not given")
            where = "by GRDSET" if number not in placed else "by its field CP"
            raise ValueError(
                f"line {first[number]}: grid point {number} lies in system {system} ({name}) {where}, which is not read"
            )
    return deck.mesh()


def _take_solid(deck: Deck, card: _Card) -> None:
    """Fields: number, property (blank: its number), nodes; of those within edges some may be blank."""
    corners, most, linear, quadratic = _SOLIDS[card.name]
    number, nodes = integer(card[0]), card.fields[2:]
    while nodes and not nodes[-1]:
        nodes.pop()
    if not corners <= len(nodes) <= most:
        raise ValueError(f"{card.name} {number} has {len(nodes)} nodes in place of {corners} or {most}")
    deck.add_cell(number, linear if len(nodes) == corners else quadratic, [integer(n) for n in nodes[:corners]])
    deck.cell_sets.setdefault(f"part_{integer(card[1] or card[0])}", []).append(number)


def _cards(path: Path) -> Iterator[_Card]:
    """The cards of the bulk data, with the lines that each one goes on in."""
    card: _Card | None = None
    for number, line in _bulk(path):
        found = _split(line, number)
        if found.name:
            if card:
                yield card
            card = found
        elif card is None:
            raise ValueError(f"line {number}: it goes on from no card")
        else:
            mark = re.split(",", line[:8])[0].strip(" +*")
            if mark and card.goes_on and mark != card.goes_on:
                card.fault = f"line {number} goes on from {mark}, which does not stand before it: sort the lines"
            card.fields += found.fields
            card.goes_on, card.fault = found.goes_on, card.fault or found.fault
    if card:
        yield card


def _split(line: str, number: int) -> _Card:
    """One line as a card of 8 fields, or 4 wide ones; without a name where it goes on from the line before."""
    first = line[:8].split(",")[0]
    wide = first.strip()[-1:] == "*" or first.startswith("*")
    count, width = (4, 16) if wide else (8, 8)
    fault = ""
    if "," in line:
        fields = [entry.strip() for entry in line.split(",")][1:]
        if any(fields[count + 1 :]):
            fault = f"line {number} has more than {count + 2} fields"
        fields, last = [*fields, *[""] * count][:count], "".join(fields[count : count + 1])
    else:
        fields, last = [line[k : k + width].strip() for k in range(8, 72, width)], line[72:80]
    goes_on = not first.strip() or first.lstrip()[0] in "+*"
    name = "" if goes_on else re.split(r"[\s*]", first.strip(), maxsplit=1)[0].upper()
    return _Card(name, number, fields, last.strip(" +*"), fault)


def _bulk(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of the bulk data with their numbers, without comments; all lines where no other section comes first."""
    begun = not any(re.match(r"\s*BEGIN\b", line, re.IGNORECASE) for line in _lines(path))
    in_bulk = begun
    for number, line in enumerate(_lines(path), 1):
        words = line.upper().split()
        if not words:
            continue
        if re.match(r"INCLUDE\b", words[0]):
            raise ValueError(f"line {number}: INCLUDE is not read: {NASTRAN_RULES.refused['INCLUDE']}")
        if words[0] == "BEGIN":
            if in_bulk or words[1:] not in (["BULK"], []):
                raise ValueError(f"line {number}: superelements and other bulk sections are not read")
            in_bulk = True
        elif words[0] == "ENDDATA" and in_bulk:
            return
        elif in_bulk:
            yield number, line


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for line in file:
            yield line.partition("$")[0].rstrip().expandtabs(8)
