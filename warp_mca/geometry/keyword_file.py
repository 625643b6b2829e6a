"""Owns the reading of LS-DYNA keyword files: nodes, solids, parts, sets of nodes and segments."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import meshio

KEYWORD_SUFFIXES = (".k", ".key", ".dyn")
_WIDTHS = {"NODE": (8, 16, 16, 16, 8, 8), "ELEMENT_SOLID": (8,) * 10}  # columns of a card's fields; elsewhere ten
_SETS = {"SET_NODE", "SET_NODE_LIST", "SET_NODE_LIST_GENERATE", "SET_SEGMENT"}
_UNREAD = ("INCLUDE", "PARAMETER", "DEFINE_TRANSFORM", "NODE_TRANSFORM", "ELEMENT_SOLID_")  # they change the mesh
Card = list[str]


@dataclass
class _Deck:
    """What the blocks of a file hold, by the file's own numbers.

    Attributes:
        by_gmsh: gmsh wrote it, whose wedges have another order.
    """

    by_gmsh: bool = False
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    solids: dict[str, list[list[int]]] = field(default_factory=dict)
    parts_of: dict[str, list[int]] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)
    sets: dict[str, list[int]] = field(default_factory=dict)


def read_keywords(path: Path) -> meshio.Mesh:
    """The solids of a keyword file, with sets of nodes and segments as point sets and parts as cell sets.

    Fields may stand in columns of the usual widths or between commas. Elements that are not solids, as shells and
    beams, are passed over, which is logged as a warning.

    Raises:
        ValueError: a card cannot be read, or the file is put together by keywords that are not read.
    """
    import meshio

    with path.open(errors="replace") as file:
        deck, left = _Deck(by_gmsh="created by Gmsh" in file.readline()), set[str]()
    for keyword, lines in _blocks(path):
        if keyword.startswith(_UNREAD):
            raise ValueError(f"*{keyword} is not read: write the mesh as one file of *NODE and *ELEMENT_SOLID")
        name = keyword.removesuffix("_TITLE")
        if name in _SETS:
            _read_set(deck, name, lines, titled=name != keyword)
        elif name in _READERS:
            _READERS[name](deck, lines)
        elif name.startswith("ELEMENT_") and any(map(_fields, lines)):
            left.add(keyword)
    if left:
        blocks = ", ".join(f"*{keyword}" for keyword in sorted(left))
        what = f"{path}: elements of {blocks} are left out, with their stiffness and mass: only *ELEMENT_SOLID is read"
        logging.getLogger("warp_mca").warning("%s", what)
    index = {number: k for k, number in enumerate(deck.nodes)}
    try:
        cells: list[Any] = [
            (kind, np.array([[index[n] for n in nodes] for nodes in rows])) for kind, rows in deck.solids.items()
        ]
        point_sets: dict[str, Any] = {
            name: np.array([index[n] for n in members]) for name, members in deck.sets.items() if members
        }
    except KeyError as error:
        raise ValueError(f"node {error.args[0]} is used but not in *NODE") from error
    cell_sets: dict[str, Any] = {}
    for number in sorted({part for parts in deck.parts_of.values() for part in parts}):
        by_block = [np.flatnonzero(np.array(parts) == number) for parts in deck.parts_of.values()]
        before = cell_sets.get(name := deck.titles.get(number) or f"part_{number}")
        cell_sets[name] = by_block if before is None else list(map(np.union1d, before, by_block))
    points = np.array(list(deck.nodes.values())).reshape(-1, 3)
    return meshio.Mesh(points, cells, point_sets=point_sets, cell_sets=cell_sets)


def _blocks(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Keywords, without what follows the first blank, and the lines of each; comments are left out."""
    keyword, lines = "", []
    with path.open(errors="replace") as file:
        for line in file:
            if line.startswith("$"):
                continue
            if line.startswith("*"):
                yield keyword, lines
                words = line[1:].upper().split() or [""]
                if words[0].endswith(("+", "%")) or (words[0] == "KEYWORD" and "LONG=" in line.upper()):
                    raise ValueError("its cards have long fields: write it in the standard format")
                keyword, lines = words[0], []
                if keyword == "END":
                    return
            else:
                lines.append(line.rstrip("\n"))
    yield keyword, lines


def _fields(line: str, widths: tuple[int, ...] = (10,) * 8) -> Card:
    """The fields of a card, without the empty ones at its end."""
    if "," in line:
        found = line.split(",")
    else:
        ends = np.cumsum((0, *widths))
        found = [line[a:b] for a, b in pairwise(ends)]
    found = [entry.strip() for entry in found]
    while found and not found[-1]:
        found.pop()
    return found


def _numbers(card: Card) -> list[int]:
    return [int(entry or 0) for entry in card]


def _read_nodes(deck: _Deck, lines: list[str]) -> None:
    """Cards: number, x, y, z, constraints."""
    for line in lines:
        card = _fields(line, _WIDTHS["NODE"])
        if card:
            x, y, z = (float(entry or 0.0) for entry in (*card[1:4], "", "", "")[:3])
            deck.nodes[int(card[0])] = (x, y, z)


def _read_solids(deck: _Deck, lines: list[str]) -> None:
    """Cards: number, part, nodes; the nodes may stand on a card of their own, or go on after a comma at its end."""
    rest: list[int] = []
    open_end = False
    for line in lines:
        card = _numbers(_fields(line, _WIDTHS["ELEMENT_SOLID"]))
        if not card:
            continue
        rest += card
        open_end = line.rstrip().endswith(",") and len(rest) == 11  # gmsh writes ten nodes so
        if len(rest) > 2 and not open_end:
            kind, nodes = _solid(rest[2:], deck.by_gmsh)
            deck.solids.setdefault(kind, []).append(nodes)
            deck.parts_of.setdefault(kind, []).append(rest[1])
            rest = []
    if rest:
        raise ValueError(f"the nodes of solid {rest[0]} are missing")


def _solid(nodes: list[int], by_gmsh: bool = False) -> tuple[str, list[int]]:
    """Type and nodes of a solid: wedges, pyramids and tetrahedra repeat their last nodes.

    LS-DYNA numbers the eight corners of a wedge 1 2 3 4 5 5 6 6, of a pyramid 1 2 3 4 5 5 5 5 and of a tetrahedron
    1 2 3 4 4 4 4 4 (LS-DYNA Keyword User's Manual, vol. I, *ELEMENT_SOLID). gmsh writes a wedge with
    the corners 1 2 3 on one triangle and 4 5 6 on the other as 1 2 3 4 5 5 6 6.
    """
    nodes = nodes[: 1 + max(k for k, node in enumerate(nodes) if node)] if any(nodes) else []
    if len(nodes) == 10 and len(set(nodes)) == 10:
        return "tetra10", nodes
    nodes = nodes[:8]
    different = list(dict.fromkeys(nodes))
    if len(nodes) == 8 and len(different) == 8:
        return "hexahedron", nodes
    if len(nodes) == 8 and len(different) == 6 and nodes[4] == nodes[5] and nodes[6] == nodes[7]:
        return "wedge", [nodes[k] for k in ((0, 1, 2, 3, 4, 6) if by_gmsh else (0, 1, 4, 3, 2, 6))]
    if len(different) == 5 and len(nodes) in (5, 8):
        return "pyramid", different
    if len(different) == 4 and len(nodes) in (4, 8):
        return "tetra", different
    raise ValueError(f"a solid with the nodes {nodes} is of no known type")


def _read_parts(deck: _Deck, lines: list[str]) -> None:
    """Pairs of cards: title; number, section, material."""
    for title, card in zip(lines[::2], lines[1::2], strict=False):
        if found := _fields(card):
            deck.titles[int(found[0])] = title.strip()


def _read_set(deck: _Deck, keyword: str, lines: list[str], titled: bool) -> None:
    """Cards: title if `titled`; number of the set; its nodes, or ranges of nodes, or four nodes of each segment."""
    head, rows = lines[titled], [_numbers(_fields(line)) for line in lines[titled + 1 :]]
    name = (lines[0].strip() if titled else "") or f"set_{int(_fields(head)[0])}"
    members = [n for row in rows for n in (row[:4] if keyword == "SET_SEGMENT" else row) if n]
    if keyword == "SET_NODE_LIST_GENERATE":
        ranges = zip(members[::2], members[1::2], strict=True)
        members = [n for low, high in ranges for n in range(low, high + 1) if n in deck.nodes]
    deck.sets.setdefault(name, []).extend(members)


_READERS: dict[str, Callable[[_Deck, list[str]], None]] = {
    "NODE": _read_nodes,
    "ELEMENT_SOLID": _read_solids,
    "PART": _read_parts,
}
