"""Owns boxes, local systems, curves and sets of a deck."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.decks.cards import Content
from warp_mca.geometry.keyword_text import Keyword, whole

Numbers = NDArray[np.int64]  # of nodes, as the deck counts them
_NONE = np.zeros(0, dtype=np.int64)
PARALLEL = 1e-9  # sine of the angle within which two axes count as parallel


class Places:
    """Boxes, systems, curves and sets by their numbers.

    Attributes:
        numbers: of all nodes of the deck, shape (node_count,), int64.
        points: their places in units of the deck, shape (node_count, 3), float64.
    """

    def __init__(self, content: Content) -> None:
        self._content = content
        nodes = content.mesh.deck.nodes
        self.numbers = np.fromiter(nodes, dtype=np.int64, count=len(nodes))
        self.points = np.array(list(nodes.values()), dtype=np.float64).reshape(-1, 3)
        self.nodes = cache(self._nodes)
        self._tables: dict[str, dict[int, Keyword]] = {}

    def _find(self, kind: str, number: int, what: str) -> Keyword:
        """The keyword of a kind with a number.

        Raises:
            ValueError: there is none.
        """
        if kind not in self._tables:
            table = self._tables[kind] = {}
            for item in self._content.found[kind]:
                table[self._content.card(item, 0, "id").whole("id")] = item
        if number not in self._tables[kind]:
            raise ValueError(f"there is no {what} {number}; add it to the deck")
        return self._tables[kind][number]

    def in_box(self, number: int) -> Numbers:
        """Nodes in a box, edges included."""
        item = self._find("box", number, "*DEFINE_BOX")
        card = self._content.card(item, 0, "id xmn xmx ymn ymx zmn zmx")
        low, high = np.array(card.numbers("xmn ymn zmn")), np.array(card.numbers("xmx ymx zmx"))
        return self.numbers[((self.points >= low) & (self.points <= high)).all(axis=1)]

    def axes(self, number: int) -> Array:
        """Axes of a system as rows, shape (3, 3); those of the world for 0.

        Raises:
            ValueError: there is no such system, or its axes are not given by three places off a line.
        """
        if not number:
            return np.eye(3)
        item = self._find("system", number, "*DEFINE_COORDINATE system")
        if item.name.endswith("NODES"):
            card = self._content.card(item, 0, "id n1 n2 n3 flag dir")
            if (card.values.get("dir") or "X").upper() != "X" or card.whole("flag"):
                raise ValueError(f"{card.place}: FLAG and DIR other than X are not read; define the system by X")
            origin, along, other = (self._place(card.whole(name), card.place) for name in ("n1", "n2", "n3"))
        elif item.name.endswith("VECTOR"):
            card = self._content.card(item, 0, "id xx yx zx xv yv zv")
            origin = np.zeros(3)
            along, other = np.array(card.numbers("xx yx zx")), np.array(card.numbers("xv yv zv"))
        else:
            card = self._content.card(item, 0, "id xo yo zo xl yl zl cidl")
            card.refuse("cidl", "give the system in the world's axes")
            origin, along = np.array(card.numbers("xo yo zo")), np.array(card.numbers("xl yl zl"))
            other = np.array(self._content.card(item, 1, "xp yp zp").numbers("xp yp zp"))
        x, z = along - origin, np.cross(along - origin, other - origin)
        if not (np.linalg.norm(z) > PARALLEL * np.linalg.norm(x) * np.linalg.norm(other - origin)):
            raise ValueError(f"{card.place}: the three places of the system lie on a line; give others")
        rows = np.array([x, np.cross(z, x), z])
        return rows / np.linalg.norm(rows, axis=1)[:, None]

    def _place(self, number: int, place: str) -> Array:
        """Where a node is, in units of the deck."""
        if (found := self._content.mesh.deck.nodes.get(number)) is None:
            raise ValueError(f"{place}: there is no node {number}; name another")
        return np.array(found)

    def curve(self, number: int) -> tuple[list[float], list[float]]:
        """Abscissas and ordinates of a curve, scaled and shifted as it says, in units of the deck."""
        item = self._find("curve", number, "*DEFINE_CURVE")
        head = self._content.card(item, 0, "id sidr sfa sfo offa offo dattyp lcint")
        head.refuse("sidr dattyp", "curves of other kinds are left out; write a plain one")
        scale = [head.number(name) or 1.0 for name in ("sfa", "sfo")]
        shift = head.numbers("offa offo")
        columns: tuple[list[float], list[float]] = [], []
        for card in self._content.cards(item, "a o", 1, (20, 20)):
            for name, column, s, d in zip("ao", columns, scale, shift, strict=True):
                column.append(s * (card.number(name) + d))
        if not columns[0]:
            raise ValueError(f"{item.place}: curve {number} has no points; add some")
        return columns

    def parts(self, number: int) -> list[int]:
        """Parts of a set of parts."""
        item, content = self._find("part_set", number, "*SET_PART"), self._content
        members = [
            whole(entry)
            for place, line in item.lines[1 + item.titled :]
            for entry in content.read(item, place, line, "1 2 3 4 5 6 7 8").values.values()
        ]
        if item.name.endswith("COLUMN"):
            members = [card.whole("id") for card in content.cards(item, "id a b c d", 1)]
        if item.name.endswith("GENERATE"):
            spans = list(zip(members[::2], members[1::2], strict=False))
            return [part for part in content.mesh.parts if any(low <= part <= high for low, high in spans if low)]
        return list(dict.fromkeys(member for member in members if member))

    def of_parts(self, parts: list[int]) -> Numbers:
        """Nodes of parts."""
        cells, members = self._content.mesh.deck.cells, self._content.mesh.parts
        found = [node for part in parts for cell in members.get(part, ()) for node in cells[cell][1]]
        return np.unique(np.array(found, dtype=np.int64))

    def segments(self, number: int) -> Numbers:
        """Nodes of a set of segments."""
        item = self._find("segment_set", number, "*SET_SEGMENT")
        names = ("n1", "n2", "n3", "n4")
        found = [card.whole(name) for card in self._content.cards(item, " ".join(names), 1) for name in names]
        return np.unique(np.array([node for node in found if node], dtype=np.int64))

    def _nodes(self, number: int) -> Numbers:
        """Nodes of a set of nodes; `nodes` keeps them."""
        item, content = self._find("node_set", number, "*SET_NODE"), self._content
        if item.name.endswith("GENERAL"):
            return self._general(item)
        if item.name.endswith("COLUMN"):
            return np.array([card.whole("id") for card in content.cards(item, "id a b c d", 1)], dtype=np.int64)
        names = "1 2 3 4 5 6 7 8"
        rows = [card.whole(name) for card in content.cards(item, names, 1) for name in names.split()]
        if item.name.endswith("GENERATE"):
            spans = [(low, high) for low, high in zip(rows[::2], rows[1::2], strict=True) if low]
            inside = [(self.numbers >= low) & (self.numbers <= high) for low, high in spans]
            return self.numbers[np.any(inside, axis=0)] if inside else _NONE
        return np.array(list(dict.fromkeys(node for node in rows if node)), dtype=np.int64)

    def _general(self, item: Keyword) -> Numbers:
        """Cards: an option, and up to seven numbers of what it adds, or, with a D, takes out."""
        names = "e1 e2 e3 e4 e5 e6 e7"
        found = _NONE
        for card in self._content.cards(item, f"option {names}", 1):
            option = card.values.get("option", "").upper()
            given = [number for name in names.split() if (number := card.whole(name))]
            match option.removeprefix("D"):
                case "ALL":
                    more = self.numbers
                case "NODE":
                    more = np.array(given, dtype=np.int64)
                case "PART":
                    more = self.of_parts(given)
                case "BOX":
                    more = np.concatenate([_NONE, *(self.in_box(box) for box in given)])
                case _:
                    remedy = "ALL, NODE, PART, BOX and those with a D are"
                    raise ValueError(f"{card.place}: the option {option} of *SET_NODE_GENERAL is not read; {remedy}")
            found = np.setdiff1d(found, more) if option.startswith("D") else np.union1d(found, more)
        return found
