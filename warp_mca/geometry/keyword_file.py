"""Owns the reading of LS-DYNA keyword files: nodes, solids, parts, sets of nodes, segments and solids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.geometry.deck import Deck, integer, real
from warp_mca.geometry.deck_rules import ELEMENTS, KEYWORD_RULES
from warp_mca.geometry.keyword_text import EIGHT, Keyword, keywords

if TYPE_CHECKING:
    import meshio

KEYWORD_SUFFIXES = (".k", ".key", ".dyn")


_NODE, _SOLID = (8, 16, 16, 16, 8, 8), (8,) * 10
_PART_CARDS = {"PART": 2, "PART_CONTACT": 3, "PART_PRINT": 3}  # of each part; of others the first one is named
Card = list[str]


def read_keywords(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The solids of a keyword file with its sets and parts, and sentences about what is left out.

    Fields may stand in columns of the usual widths or between commas.

    Raises:
        ValueError: a card cannot be read, or a keyword would change the mesh in a way that is not read.
    """
    reader = MeshReader(path)
    try:
        for block in keywords(path):
            reader.take(block)
    except ValueError as error:
        raise ValueError(reader.at(error)) from error
    return reader.finish()


class MeshReader:
    """Takes the keywords of a deck in turn. Wedges of gmsh, as the first line tells, have another order.

    Attributes:
        deck: what was read.
        place: of the card that is being read.
        titles: of parts, by number.
        parts: solids of each part.
        held: code of the axes along which a node is held, by its number, as its card has it.
    """

    def __init__(self, path: Path) -> None:
        with path.open(errors="replace") as file:
            self.by_gmsh = "created by Gmsh" in file.readline()
        self.deck, self.place = Deck(path), ""
        self.titles: dict[int, str] = {}
        self.parts: dict[int, list[int]] = {}
        self.held: dict[int, int] = {}
        self._ranges: list[tuple[dict[str, list[int]], str, range]] = []  # of members: table and name of the set

    def at(self, error: ValueError) -> str:
        """An error with the place of the card, unless it names one."""
        return str(error) if str(error).startswith("line ") or not self.place else f"{self.place}: {error}"

    def take(self, block: Keyword) -> None:
        """Read one keyword, or count it."""
        self.place, name = block.place, block.name
        try:
            kind = KEYWORD_RULES.kind(name)
        except ValueError as error:
            raise ValueError(f"*{error}") from error
        if name in ("NODE", "ELEMENT_SOLID"):
            self.take_mesh(block)
        elif kind == "read" and name.startswith("SET_"):
            self._take_set(block)
        elif name == "ELEMENT_SHELL" and self.by_gmsh:
            self._take_marks(block)
        else:
            if name.startswith("PART"):
                self._take_titles(block)
            cards = sum(bool(line.strip()) for _, line in block.lines)
            if cards and kind == ELEMENTS:
                self.deck.left[kind, f"cards of *{name}"] += cards
            elif kind not in ("", "read", ELEMENTS):
                self.deck.left[kind, f"*{name}"] += 1

    def take_mesh(self, block: Keyword) -> None:
        """Read *NODE or *ELEMENT_SOLID."""
        if block.name == "NODE":
            self._take_nodes(block)
        else:
            self._take_solids(block)

    def _cards(self, block: Keyword, widths: Sequence[int] = EIGHT) -> Iterator[Card]:
        for self.place, line in block.lines:
            if card := block.fields(line, widths):
                yield card

    def _take_nodes(self, block: Keyword) -> None:
        """Cards: number, x, y, z, constraints."""
        for card in self._cards(block, _NODE):
            x, y, z = (real(entry) for entry in (*card[1:4], "", "", "")[:3])
            self.deck.add_node(integer(card[0]), (x, y, z))
            if len(card) > 4 and (code := int(real(card[4]))):
                self.held[integer(card[0])] = code

    def _take_solids(self, block: Keyword) -> None:
        """Cards: number, part, nodes; the nodes may stand on a card of their own, or go on after a comma at its end."""
        rest: list[int] = []
        for self.place, line in block.lines:
            rest += [integer(entry or "0") for entry in block.fields(line, _SOLID)]
            open_end = line.endswith(",") and len(rest) == 11  # gmsh writes ten nodes so
            if len(rest) > 2 and not open_end:
                kind, nodes = _solid(rest[2:], self.by_gmsh)
                self.deck.add_cell(rest[0], kind, nodes)
                self.parts.setdefault(rest[1], []).append(rest[0])
                rest = []
        if rest:
            raise ValueError(f"the nodes of solid {rest[0]} are missing")

    def _take_marks(self, block: Keyword) -> None:
        """Cards: number, part, nodes; of shells, which gmsh writes for named surfaces, beside solids of any number."""
        for number, _, *nodes in self._cards(block, _SOLID):
            corners = list(dict.fromkeys(integer(entry) for entry in nodes[:4]))
            self.deck.add_face(-integer(number), "*ELEMENT_SHELL", corners, mark=True)

    def _take_titles(self, block: Keyword) -> None:
        """Cards of each part: title; number, section, material; others, as the keyword has them."""
        count = _PART_CARDS.get(block.name, max(2, len(block.lines)))
        for (_, title), (self.place, card) in zip(block.lines[::count], block.lines[1::count], strict=False):
            if found := block.fields(card):
                self.titles[integer(found[0])] = title.strip()

    def _take_set(self, block: Keyword) -> None:
        """Cards: a title, if any; number of the set; its members, ranges of them, or four nodes of each segment."""
        name, titled = block.name, block.titled
        lines = [line for _, line in block.lines]
        title = lines[0].strip() if titled else ""
        key = title or f"set_{integer(block.fields(lines[titled])[0])}"
        members: list[int] = []
        used = {"SET_SEGMENT": 4, "SET_NODE_COLUMN": 1}.get(name, 8)
        for self.place, line in block.lines[titled + 1 :]:
            members += [n for entry in block.fields(line)[:used] if (n := integer(entry or "0"))]
        sets = self.deck.cell_sets if name.startswith("SET_SOLID") else self.deck.node_sets
        sets.setdefault(key, [])
        if name.endswith("_GENERATE"):
            ranges = zip(members[::2], members[1::2], strict=True)
            self._ranges += [(sets, key, range(low, high + 1)) for low, high in ranges]
        else:
            sets[key] += members

    def finish(self) -> tuple[meshio.Mesh, list[str]]:
        """The mesh, and sentences about what is left out."""
        deck = self.deck
        for sets, key, span in self._ranges:
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
