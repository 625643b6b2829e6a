"""Owns the reading of LS-DYNA keyword files: nodes, solids, parts, sets of nodes, segments and solids."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.geometry.deck import Block, Deck, blocks, integer, real
from warp_mca.geometry.deck_rules import ELEMENTS, KEYWORD_RULES

if TYPE_CHECKING:
    import meshio

KEYWORD_SUFFIXES = (".k", ".key", ".dyn")


def _columns(*widths: int) -> list[slice]:
    """The columns of the fields of a card."""
    return [slice(a, b) for a, b in pairwise(accumulate(widths, initial=0))]


_NODE, _SOLID, _OTHER = _columns(8, 16, 16, 16, 8, 8), _columns(*[8] * 10), _columns(*[10] * 8)
_PART_CARDS = {"PART": 2, "PART_CONTACT": 3, "PART_PRINT": 3}  # of each part; of others the first one is named
Card = list[str]


def read_keywords(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The solids of a keyword file with its sets and parts, and sentences about what is left out.

    Fields may stand in columns of the usual widths or between commas.

    Raises:
        ValueError: a card cannot be read, or a keyword would change the mesh in a way that is not read.
    """
    with path.open(errors="replace") as file:
        reader = _Reader(Deck(path), "created by Gmsh" in file.readline())
    for block in blocks(path, "$"):
        if block.keyword.upper().split()[:1] == ["END"]:
            break
        try:
            reader.take(block)
        except ValueError as error:
            raise ValueError(f"line {reader.line}: {error}") from error
    return reader.finish()


def _fields(line: str, columns: list[slice] = _OTHER) -> Card:
    """The fields of a card, without the empty ones at its end."""
    found = [entry.strip() for entry in (line.split(",") if "," in line else [line[part] for part in columns])]
    while found and not found[-1]:
        found.pop()
    return found


class _Reader:
    """Takes the blocks of a file in turn; `by_gmsh`: gmsh wrote it, whose wedges have another order."""

    def __init__(self, deck: Deck, by_gmsh: bool) -> None:
        self.deck, self.by_gmsh, self.line = deck, by_gmsh, 0
        self.titles: dict[int, str] = {}
        self.parts: dict[int, list[int]] = {}  # solids of each part
        self.ranges: list[tuple[dict[str, list[int]], str, range]] = []  # of members: table and name of the set

    def take(self, block: Block) -> None:
        """Read one block, or count it."""
        self.line, text = block.line, block.keyword.upper()
        words = text.split() or [""]
        if words[0].endswith(("+", "%")) or (words[0] == "KEYWORD" and ("LONG=" in text or "I10=Y" in text)):
            raise ValueError("its cards have long fields, not the standard ones")
        name = words[0].rstrip("-").removesuffix("_TITLE")
        try:
            kind = KEYWORD_RULES.kind(name)
        except ValueError as error:
            raise ValueError(f"*{error}") from error
        if name == "NODE":
            self._take_nodes(block)
        elif name == "ELEMENT_SOLID":
            self._take_solids(block)
        elif kind == "read" and name.startswith("SET_"):
            self._take_set(name, block, titled="_TITLE" in words[0])
        elif name == "ELEMENT_SHELL" and self.by_gmsh:
            self._take_marks(block)
        else:
            if name.startswith("PART"):
                self._take_titles(name, block)
            cards = sum(bool(text.strip()) for _, text in block.data)
            if cards and kind == ELEMENTS:
                self.deck.left[kind, f"cards of *{name}"] += cards
            elif cards and kind not in ("", "read"):
                self.deck.left[kind, f"*{name}"] += 1

    def _cards(self, block: Block, columns: list[slice] = _OTHER) -> Iterator[Card]:
        for self.line, text in block.data:
            if card := _fields(text, columns):
                yield card

    def _take_nodes(self, block: Block) -> None:
        """Cards: number, x, y, z, constraints."""
        for card in self._cards(block, _NODE):
            x, y, z = (real(entry) for entry in (*card[1:4], "", "", "")[:3])
            self.deck.add_node(integer(card[0]), (x, y, z))

    def _take_solids(self, block: Block) -> None:
        """Cards: number, part, nodes; the nodes may stand on a card of their own, or go on after a comma at its end."""
        rest: list[int] = []
        for self.line, text in block.data:
            rest += [integer(entry or "0") for entry in _fields(text, _SOLID)]
            open_end = text.endswith(",") and len(rest) == 11  # gmsh writes ten nodes so
            if len(rest) > 2 and not open_end:
                kind, nodes = _solid(rest[2:], self.by_gmsh)
                self.deck.add_cell(rest[0], kind, nodes)
                self.parts.setdefault(rest[1], []).append(rest[0])
                rest = []
        if rest:
            raise ValueError(f"the nodes of solid {rest[0]} are missing")

    def _take_marks(self, block: Block) -> None:
        """Cards: number, part, nodes; of shells, which gmsh writes for named surfaces, beside solids of any number."""
        for number, _, *nodes in self._cards(block, _SOLID):
            corners = list(dict.fromkeys(integer(entry) for entry in nodes[:4]))
            self.deck.add_face(-integer(number), "*ELEMENT_SHELL", corners, mark=True)

    def _take_titles(self, name: str, block: Block) -> None:
        """Cards of each part: title; number, section, material; others, as the keyword has them."""
        count = _PART_CARDS.get(name, max(2, len(block.data)))
        for (_, title), (self.line, card) in zip(block.data[::count], block.data[1::count], strict=False):
            if found := _fields(card):
                self.titles[integer(found[0])] = title.strip()

    def _take_set(self, name: str, block: Block, titled: bool) -> None:
        """Cards: title if `titled`; number of the set; its members, ranges of them, or four nodes of each segment."""
        lines = [text for _, text in block.data]
        title = lines[0].strip() if titled else ""
        key = title or f"set_{integer(_fields(lines[titled])[0])}"
        members: list[int] = []
        used = {"SET_SEGMENT": 4, "SET_NODE_COLUMN": 1}.get(name, 8)
        for self.line, text in block.data[titled + 1 :]:
            members += [n for entry in _fields(text)[:used] if (n := integer(entry or "0"))]
        sets = self.deck.cell_sets if name.startswith("SET_SOLID") else self.deck.node_sets
        sets.setdefault(key, [])
        if name.endswith("_GENERATE"):
            ranges = zip(members[::2], members[1::2], strict=True)
            self.ranges += [(sets, key, range(low, high + 1)) for low, high in ranges]
        else:
            sets[key] += members

    def finish(self) -> tuple[meshio.Mesh, list[str]]:
        """The mesh, and sentences about what is left out."""
        deck = self.deck
        for sets, key, span in self.ranges:
            known = deck.nodes if sets is deck.node_sets else deck.cells
            sets[key] += [n for n in known if n in span]
        for number in sorted(self.parts):
            deck.cell_sets.setdefault(self.titles.get(number) or f"part_{number}", []).extend(self.parts[number])
        return deck.mesh()


def _solid(nodes: list[int], by_gmsh: bool) -> tuple[str, list[int]]:
    """Type and nodes of a solid: wedges, pyramids and tetrahedra repeat their last nodes.

    LS-DYNA numbers the eight corners of a wedge 1 2 3 4 5 5 6 6, of a pyramid 1 2 3 4 5 5 5 5 and of a tetrahedron
    1 2 3 4 4 4 4 4 (LS-DYNA Keyword User's Manual, vol. I, *ELEMENT_SOLID). gmsh writes a wedge with
    the corners 1 2 3 on one triangle and 4 5 6 on the other as 1 2 3 4 5 5 6 6.
    """
    nodes = nodes[: 1 + max(k for k, node in enumerate(nodes) if node)] if any(nodes) else []
    if len(nodes) == 10 and len(set(nodes)) == 10:
        return "tetra10", nodes
    if set(nodes[8:]) - {0, *nodes[:8]}:
        raise ValueError(f"a solid with {len(nodes)} nodes is of no known type")
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
