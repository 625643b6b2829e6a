"""Owns the reading of Nastran bulk data: grid points in their coordinate systems, solids by property."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.deck import Deck, integer, real
from warp_mca.geometry.deck_rules import NASTRAN_RULES
from warp_mca.geometry.nastran_systems import Systems

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
_NARROW, _WIDE = ([slice(k, k + width) for k in range(8, 72, width)] for width in (8, 16))  # columns of fields
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
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        reader = _Reader(Deck(path), "created by gmsh" in file.readline().lower())
    for card in _cards(path):
        try:
            reader.take(card)
        except ValueError as error:
            raise ValueError(f"line {card.line}: {error}") from error
    return reader.finish()


class _Reader:
    """Takes the cards of a file in turn; `by_gmsh`: gmsh wrote it, whose shells and bars mark faces and edges."""

    def __init__(self, deck: Deck, by_gmsh: bool) -> None:
        self.deck, self.by_gmsh, self.default = deck, by_gmsh, ""
        self.grid: dict[int, tuple[str, list[float], int]] = {}  # system, coordinates, line
        self.systems = Systems(self._place)
        self.placing: set[int] = set()

    def take(self, card: _Card) -> None:
        """Read one card, or count it."""
        kind = NASTRAN_RULES.kind(card.name)
        if kind == "read" and card.fault:
            raise ValueError(card.fault)
        if card.name == "GRID":
            self._take_grid(card)
        elif card.name == "GRDSET":
            self.default = card[1]
        elif card.name.startswith("CORD2") and kind == "read":
            points = [real(card[k]) for k in range(2, 11)]
            self.systems.by_points(integer(card[0]), card.name, integer(card[1] or "0"), points)
        elif card.name.startswith("CORD") and kind == "read":  # CORD1R has up to two systems; others are not read
            for start in (0, 4) if card[4] else (0,):
                points = [integer(card[start + k] or "0") for k in (1, 2, 3)] if card.name[4] == "1" else []
                self.systems.by_grid_points(integer(card[start]), card.name, points)
        elif card.name in _SOLIDS:
            _take_solid(self.deck, card)
        elif self.by_gmsh and card.name in _MARKS:
            corners = [integer(card[2 + k]) for k in range(_MARKS[card.name])]
            self.deck.add_face(integer(card[0]), card.name, corners, mark=True)
        elif kind and kind != "read":
            self.deck.left[kind, card.name] += 1

    def _take_grid(self, card: _Card) -> None:
        number, found = integer(card[0]), (card[1], [real(card[k]) for k in (2, 3, 4)], card.line)
        if self.grid.setdefault(number, found)[:2] != found[:2]:
            raise ValueError(f"grid point {number} is given twice, also in line {self.grid[number][2]}")

    def _place(self, number: int) -> NDArray[np.float64]:
        """Where a grid point lies in the basic system."""
        if number not in self.grid:
            raise ValueError(f"grid point {number} is not given")
        if number in self.placing:
            raise ValueError(f"grid point {number} lies in a system that it defines")
        self.placing.add(number)
        system, coordinates, _ = self.grid[number]
        place = self.systems.place(integer(system or self.default or "0"), coordinates)
        self.placing.remove(number)
        return place

    def finish(self) -> tuple[meshio.Mesh, list[str]]:
        """The mesh, and sentences about what is left out."""
        for number, (system, coordinates, line) in self.grid.items():
            if (system or self.default or "0") == "0":
                x, y, z = coordinates
            else:
                try:
                    x, y, z = self._place(number).tolist()
                except ValueError as error:
                    raise ValueError(f"line {line}: grid point {number}: {error}") from error
            self.deck.add_node(number, (x, y, z))
        return self.deck.mesh()


def _take_solid(deck: Deck, card: _Card) -> None:
    """Fields: number, property (blank: its number), nodes; of those within edges some may be blank."""
    corners, most, linear, quadratic = _SOLIDS[card.name]
    number, nodes = integer(card[0]), card.fields[2:]
    while nodes and not nodes[-1]:
        nodes.pop()
    if not corners <= len(nodes) <= most:
        raise ValueError(f"{card.name} {number} has {len(nodes)} nodes in place of {corners} or {most}")
    kept = nodes if all(nodes) else nodes[:corners]
    deck.add_cell(number, linear if len(nodes) == corners else quadratic, [integer(n) for n in kept])
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
            mark = line[:8].partition(",")[0].strip(" +*")
            if mark and card.goes_on and mark != card.goes_on:
                card.fault = f"line {number} goes on from {mark}, which does not stand before it: sort the lines"
            card.fields += found.fields
            card.goes_on, card.fault = found.goes_on, card.fault or found.fault
    if card:
        yield card


def _split(line: str, number: int) -> _Card:
    """One line as a card of 8 fields, or 4 wide ones; without a name where it goes on from the line before."""
    first = line[:8].partition(",")[0]
    wide = "*" in first
    count = 4 if wide else 8
    fault = ""
    if "," in line:
        fields = [entry.strip() for entry in line.split(",")][1:]
        if any(fields[count + 1 :]):
            fault = f"line {number} has more than {count + 2} fields"
        fields, last = [*fields, *[""] * count][:count], "".join(fields[count : count + 1])
    else:
        fields, last = [line[part].strip() for part in (_WIDE if wide else _NARROW)], line[72:80]
    goes_on = not first.strip() or first.lstrip()[0] in "+*"
    name = "" if goes_on else first.split()[0].rstrip("*").upper()
    return _Card(name, number, fields, last.strip(" +*"), fault)


def _bulk(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of the bulk data with their numbers, without comments; all lines where no other section comes first."""
    in_bulk = not any(line[:16].upper().split()[:1] == ["BEGIN"] for line in _lines(path))
    for number, line in enumerate(_lines(path), 1):
        head = line[:16].upper().split(maxsplit=1)[:1]
        if not head:
            continue
        if head[0].startswith("INCLUDE"):
            raise ValueError(f"line {number}: INCLUDE is not read: {NASTRAN_RULES.refused['INCLUDE']}")
        if head[0] == "BEGIN":
            if in_bulk or line.upper().split()[1:] not in (["BULK"], []):
                raise ValueError(f"line {number}: superelements and other bulk sections are not read")
            in_bulk = True
        elif head[0] == "ENDDATA" and in_bulk:
            return
        elif in_bulk:
            yield number, line


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for line in file:
            yield (line.partition("$")[0] if "$" in line else line).rstrip().expandtabs(8)
